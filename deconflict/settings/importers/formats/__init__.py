"""One reader for each format of plans."""
