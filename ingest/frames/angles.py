"""Angles on a circle."""

from math import pi


def turn_between(before_rad: float, after_rad: float) -> float:
    """The shorter turn from one yaw to another, in [-pi, pi)."""
    turn_rad = after_rad - before_rad + pi
    return (turn_rad if 0.0 <= turn_rad < 2 * pi else turn_rad % (2 * pi)) - pi
