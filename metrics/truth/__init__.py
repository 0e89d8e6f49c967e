"""What really happened, from the recording."""
