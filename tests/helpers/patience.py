"""How long tests wait for an event."""

PATIENCE_S = 180.0
"""Enough for a machine many times slower than any in use. Only an event that never comes takes this long."""
