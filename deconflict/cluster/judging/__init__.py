"""What an engine of a cluster judges: the conflicts of its tiles, and on one engine everything that has no tile."""
