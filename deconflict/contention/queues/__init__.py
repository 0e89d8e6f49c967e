"""Queues at docks, chargers, lifts and zones: who waits how long, and in which order."""
