"""How good warnings were, in the words that people read. Reports, tables and comparisons read every figure of quality
here, so that one word has one figure.

| word | meaning |
| --- | --- |
| event | two robots came within the clearance, or one stopped or swerved for the other |
| warned of | an event with a warning in the 10 s before |
| came true | a warning with an event within 10 s; one event makes one warning true |
| in vain | a warning without one |
| not judged | a warning of which nobody can say: a robot left, followed advice, or the event had begun |
| ahead by | from raising the warning to the event that was warned of |
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

NOT_JUDGED = {
    "heeded": "followed advice",
    "in_progress": "came after the beginning",
    "unknown": "had no known outcome",
}
"""The counts that are not judged, each with what it says of a warning."""


def not_judged(counts: Mapping[str, Any]) -> int:
    """Of warnings or situations, how many are not judged."""
    return sum(counts[name] for name in NOT_JUDGED)


class WarningQuality(NamedTuple):
    """What came of the warnings of a log, or of those of one vendor, pair of vendors or class of encounter."""

    events: int
    stops: int
    encounters: int
    warned_of: int
    warned_of_2_s: int
    """Of the events, at least 2 s ahead, by a warning that was still open."""
    warned_of_4_s: int
    warnings: int
    came_true: int
    in_vain: int
    not_judged: int
    ahead_by_s: Mapping[str, float] | None
    """Median, p10 and p90 of the events that were warned of; None if there were none."""
    robot_hours: float

    @classmethod
    def of(cls, part: Mapping[str, Any]) -> "WarningQuality":
        """Of `warnings` or `believer` in a replay's result, or of a row of their `by_vendor` or `by_vendor_pair`."""
        return cls(
            events=_events(part, "fresh"),
            stops=part["stops"]["fresh"],
            encounters=part["encounters"]["fresh"],
            warned_of=_events(part, "told_at_any_time"),
            warned_of_2_s=_events(part, "told_2_s"),
            warned_of_4_s=_events(part, "told_4_s"),
            warnings=part["alerts"],
            came_true=part["true"],
            in_vain=part["in_vain"],
            not_judged=not_judged(part),
            ahead_by_s=part["ahead_by_s"],
            robot_hours=part["robot_hours"],
        )

    @property
    def judged(self) -> int:
        return self.came_true + self.in_vain

    @property
    def share_warned_of(self) -> float | None:
        return _share(self.warned_of, self.events)

    @property
    def share_came_true(self) -> float | None:
        return _share(self.came_true, self.judged)

    @property
    def warnings_per_robot_hour(self) -> float | None:
        return _share(self.warnings, self.robot_hours)


def _events(part: Mapping[str, Any], name: str) -> int:
    kinds = part["stops"], part["encounters"]
    if name == "fresh":
        return sum(int(kind["fresh"]) for kind in kinds)
    return sum(round(kind["fresh"] * (kind[name] or 0.0)) for kind in kinds)


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole else None
