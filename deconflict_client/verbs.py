"""What may be asked of a robot, and who does it.

A module of its own: programs that only follow the service load it without numpy.
"""

from typing import Literal

Verb = Literal["wait_before", "go_first", "step_aside", "go_around", "back_out", "other_way"]

Side = Literal["left", "right"]
"""Of another robot, seen along the way of the robot that goes around it."""

Followed = tuple[str, str]
"""A robot that does what it was asked, and the robot for which it was asked; UUIDs."""
