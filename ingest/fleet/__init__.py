"""The state of all robots, the forecast of each, and batches of what changed."""
