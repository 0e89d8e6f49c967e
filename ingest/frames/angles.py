"""Angles on a circle."""

from math import pi


def turn_between(before_rad: float, after_rad: float) -> float:
    """The shorter turn from one yaw to another, in [-pi, pi)."""
    return (after_rad - before_rad + pi) % (2 * pi) - pi
