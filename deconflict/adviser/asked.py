"""Requests that were made: which robots follow them, and how long that takes."""

from dataclasses import dataclass, field

from deconflict.adviser.request import Request

Answer = str
BEGINS_WITHIN_S = 3.0
"""A robot that follows has set out by then. Else another is asked."""
MOVED_M = 0.15
USUALLY_FOLLOWS, USUAL_WEIGHT = 0.7, 2.0
"""How likely a robot follows that was never asked, and how many requests that counts for."""


@dataclass(slots=True)
class Asked:
    """One request and what came of it."""

    request: Request
    asked_s: float
    from_m: tuple[float, float]
    """Where the robot was when it was asked."""
    answer: str = ""
    why: str = ""
    begun_s: float | None = None
    ended: bool = False


@dataclass(slots=True)
class Following:
    """How often a robot was asked, and how often it followed."""

    asked: int = 0
    followed: int = 0
    declined_s: dict[tuple[str, str | None], float] = field(default_factory=dict)
    """By verb and other robot: when it last declined."""

    @property
    def likely(self) -> float:
        """The probability that it follows the next request."""
        return (self.followed + USUALLY_FOLLOWS * USUAL_WEIGHT) / (self.asked + USUAL_WEIGHT)
