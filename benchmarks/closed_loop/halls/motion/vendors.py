"""Three vendors: their robots, what they do when they are blocked, and who follows requests."""

from dataclasses import dataclass
from math import inf

VENDORS = ("Amber", "Birch", "Cedar")
LENGTHS_M, WIDTHS_M, TOPS_MPS = (
    ((0.7, 0.8), (0.95, 1.05), (1.2, 1.3)),
    ((0.5, 0.55), (0.6, 0.7), (0.7, 0.75)),
    (1.4, 1.2, 1.0),
)


@dataclass(frozen=True, slots=True)
class Habit:
    """What a vendor's robot does when a body of another vendor has blocked it for a while."""

    patience_s: float
    tries: tuple[str, ...] = ()


PATIENT = Habit(inf)
HABITS: dict[str, tuple[Habit, Habit, Habit]] = {
    "replan_5s": (Habit(5.0, ("other_way",)),) * 3,
    "wait_15s": (Habit(15.0, ("go_around", "back_out")),) * 3,
    "around_15s": (Habit(15.0, ("go_around",)),) * 3,
    "for_ever": (PATIENT,) * 3,
    "mixed": (Habit(5.0, ("other_way",)), Habit(15.0, ("go_around", "back_out")), PATIENT),
}


@dataclass(frozen=True, slots=True)
class Compliance:
    """How requests reach robots, and which robots follow them."""

    share: float = 1.0
    """Of the robots, drawn."""
    delay_s: tuple[float, float] = (0.3, 0.3)
    """Least and greatest."""
    unwilling: str = ""
    """A vendor whose robots never follow."""
    declines: bool = False
    """Whether robots that do not follow say so."""


ALL_FOLLOW = Compliance()
