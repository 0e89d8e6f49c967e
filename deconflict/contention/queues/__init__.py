"""Queues at shared places: how long robots will wait, and in which order they should be served."""
