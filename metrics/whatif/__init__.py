"""What would change: the recorded demand, driven again by simulated robots."""
