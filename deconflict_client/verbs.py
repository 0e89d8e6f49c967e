"""What may be asked of a robot, and who does it.

A module of its own: programs that only follow the service load it without numpy.
"""

from typing import Literal

Verb = Literal["wait_before", "go_first", "step_aside", "go_around", "back_out", "other_way"]

Followed = tuple[str, str]
"""A robot that does what it was asked, and the robot for which it was asked; UUIDs."""
