"""Which robots are on the floor, and how likely each silent robot still is."""
