"""What conflicts are asked about, and when."""
