"""What is asked of one robot."""

from dataclasses import dataclass
from typing import Literal

Verb = Literal["wait_before", "go_first", "step_aside", "go_around", "back_out", "other_way"]


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of one robot. Positions are in the site's frame, times are seconds since the epoch."""

    id: str
    robot: str
    """UUID of the robot that is asked."""
    verb: Verb
    at: tuple[float, float] | None
    """(x, y) in metres: the point of its way not to pass, or where to go."""
    other: str | None
    """UUID of the robot for which it is asked."""
    until: tuple[str, ...]
    """UUIDs of the robots that must have passed."""
    latest_s: float
    """When the request ends at the latest."""
    withdrawn: bool = False
