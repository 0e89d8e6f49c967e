"""Processes, logs and calls between processes. Nothing in this folder knows about robots."""
