"""The recorded demand, driven by simulated robots."""
