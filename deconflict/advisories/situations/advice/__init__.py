"""What to do about situations, and what is at stake."""
