"""What a restart needs: the state of the fleet from the log, and from a file of what the log may no longer have."""
