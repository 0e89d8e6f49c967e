"""The message log: written, rotated and read back."""
