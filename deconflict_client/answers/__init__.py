"""What the HTTP API reads and returns."""
