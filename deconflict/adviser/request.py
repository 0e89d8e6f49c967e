"""What is asked of one robot."""

from dataclasses import dataclass

from deconflict_client.verbs import Side
from deconflict_client.verbs import Verb as Verb  # noqa: PLC0414 - callers import it from here


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
    saving_s: float | None = None
    """Seconds that all robots are expected to save in the next minute."""
    saving_interval_s: tuple[float, float] | None = None
    """80 % interval of these seconds."""
    side: Side | None = None
    """On which side of the other it goes around it, seen along its own way; None if that is left to the robot."""
    beside: tuple[float, float] | None = None
    """The point beside the other on this side that it drives over."""
