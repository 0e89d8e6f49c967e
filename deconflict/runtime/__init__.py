"""Processes, logs and calls between processes. Nothing here knows of robots."""
