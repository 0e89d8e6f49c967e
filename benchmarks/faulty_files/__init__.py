"""Each file of the data directory is made unusable, at a start and while the service runs."""
