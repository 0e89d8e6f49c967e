"""How long tests wait for what comes by itself."""

PATIENCE_S = 180.0
"""Enough on a machine many times slower than any that is used; only what never comes takes so long."""
