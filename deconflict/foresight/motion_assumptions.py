"""What is assumed of the motion of robots, wherever it is found in reports or simulated."""

JOINED_S = 2.1
"""Reports further apart do not tell the motion between them."""
SPACED_S = 0.9
"""Minimum time between two kept reports, or forecasts, of a robot."""
BRAKES_MPS2 = 1.0
"""Deceleration and acceleration of every robot."""
LOST_S, MOVES_MPS = 1.0, 0.3
"""A robot gives way if it drove at least this fast, and loses this much time."""
RESTING_STATES = frozenset(("charging", "disabled", "offline"))
"""Operational states of robots that stay where they are."""
CROSSING_S = 8.0
"""Robots that have stood for so long before a free crossing wait for each other, whatever they say."""
CROSSING_M = 4.6
"""How far robots stop before it, at most: as far as the largest crossings need."""
