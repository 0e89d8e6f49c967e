"""Floors cut into tiles, their owners, and the channel of each robot."""
