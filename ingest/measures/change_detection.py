"""Detects whether a repeated measurement has changed, since when, and by how much.

It uses a two-sided CUSUM test (Page 1954, Continuous inspection schemes, Biometrika 41) on the deviations of values
from the usual level, divided by the usual spread. Level and spread are learned from the first values and follow later
values over days, but not while a change is suspected. A change is over once values are usual again. A change that lasts
a day becomes the usual level.
"""

from dataclasses import dataclass, field
from math import inf, sqrt
from statistics import median
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import ConfigDict, Field, TypeAdapter

LEARNED = 15
"""Values from which the first usual level is learned."""
HALF_LIFE_S = 86_400.0
"""Time in which the usual level goes half the way to the present values."""
SLACK, ALARM = 1.0, 16.0
"""In usual deviations: a deviation counts beyond `SLACK`, and a sum beyond `ALARM` is an alarm."""
FARTHEST = 4.0
"""A single value counts as at most this many usual deviations."""
NEWEST = 15
"""The size of a change is the median of this many newest values."""
WORTH = 2.0
"""A change must be at least this many usual deviations."""
CALM, CALM_WITHIN = 5, 1.5
"""A change is over after `CALM` values in a row within `CALM_WITHIN` usual deviations."""
ADOPTED_S = 86_400.0
"""A change that lasts this long becomes the usual level."""
UP, DOWN = 0, 1
MOST_SEEN = 10**15
"""A state with more values is damaged."""


Sides = Annotated[list[float], Field(min_length=2, max_length=2)]


class LevelChange(NamedTuple):
    """A detected change of a level."""

    since_s: float
    """When it began."""
    by: float
    """By how much the level is above the usual one; negative if it is below."""


@dataclass(frozen=True, slots=True)
class ChangeLimits:
    """What counts as a change, in the unit of the values."""

    least_spread: float
    """The usual spread is at least this."""
    least_change: float
    """Smaller changes are ignored."""
    rises_only: bool = False
    """Whether falls are ignored."""


@dataclass(slots=True)
class ChangeDetector:
    """Detects changes of one measured quantity."""

    __pydantic_config__: ClassVar = ConfigDict(allow_inf_nan=False)
    limits: ChangeLimits
    seen: Annotated[int, Field(ge=0, le=MOST_SEEN)] = 0
    """Values so far."""
    usual: float = 0.0
    """The usual level."""
    variance: Annotated[float, Field(ge=0)] = 0.0
    """Of values around the usual level."""
    at_s: float = 0.0
    """The time of the newest value."""
    sums: Sides = field(default_factory=lambda: [0.0, 0.0])
    """CUSUM sums of deviations above and below the usual level, in usual deviations."""
    began_s: Sides = field(default_factory=lambda: [0.0, 0.0])
    """The time of the first value in each sum."""
    newest: Annotated[list[tuple[float, float]], Field(max_length=NEWEST)] = field(default_factory=list)
    """The newest values with their times."""
    change: LevelChange | None = None
    """The change that stands; None if there is none."""
    calm: Annotated[int, Field(ge=0, le=CALM)] = 0
    """Usual values in a row since the change."""

    @property
    def spread(self) -> float:
        """The usual deviation."""
        return max(sqrt(self.variance), self.limits.least_spread)

    def add(self, value: float, at_s: float) -> None:
        """Add a value that holds from `at_s` on. Times may go back if a clock is set back."""
        self.newest = [*self.newest[1 - NEWEST :], (at_s, value)]
        if self.seen < LEARNED:
            self._begin()
        elif self.change:
            self._follow(value, self.change, at_s)
        else:
            self._test(value, at_s)
        self.at_s = at_s

    def learned(self) -> dict[str, Any]:
        """The whole state, JSON-ready."""
        return _STATE.dump_python(self, mode="json")

    @classmethod
    def resumed(cls, limits: ChangeLimits, state: object, most: float = inf) -> "ChangeDetector":
        """The detector with a state that `learned` returned. No value is beyond `most`. Raises `ValueError`."""
        detector = _STATE.validate_python(state)
        by = detector.change.by if detector.change else 0.0
        values = (detector.usual, sqrt(detector.variance), by, *(value for _, value in detector.newest))
        if max(map(abs, values)) > most:
            raise ValueError(f"a value is beyond {most:g}")
        detector.limits = limits
        return detector

    def _begin(self) -> None:
        self.seen += 1
        if self.seen == LEARNED:
            values = [value for _, value in self.newest]
            self.usual = median(values)
            self.variance = (1.4826 * median(abs(value - self.usual) for value in values)) ** 2

    def _test(self, value: float, at_s: float) -> None:
        off = (value - self.usual) / self.spread
        off = min(max(off, -FARTHEST), FARTHEST)
        for side, beyond in ((UP, off - SLACK), (DOWN, -off - SLACK)):
            if self.sums[side] <= 0:
                self.began_s[side] = at_s
            self.sums[side] = max(self.sums[side] + beyond, 0.0)
            if self.sums[side] > ALARM:
                self._alarm(side)
        if max(self.sums) < ALARM / 2:
            self._learn(off, at_s)

    def _learn(self, off: float, at_s: float) -> None:
        self.seen += 1
        share = max(1 / self.seen, 1 - 0.5 ** (max(at_s - self.at_s, 0.0) / HALF_LIFE_S))
        deviation = off * self.spread
        self.usual += share * deviation
        self.variance += share * (deviation**2 - self.variance)

    def _alarm(self, side: int) -> None:
        since_s, self.sums = self.began_s[side], [0.0, 0.0]
        by = self._change_since(since_s)
        if abs(by) >= max(self.limits.least_change, WORTH * self.spread) and (side == UP or not self.limits.rises_only):
            self.change, self.calm = LevelChange(since_s, by), 0

    def _follow(self, value: float, change: LevelChange, at_s: float) -> None:
        usual = abs(value - self.usual) <= max(CALM_WITHIN * self.spread, self.limits.least_change / 2)
        self.calm = self.calm + 1 if usual else 0
        self.change = LevelChange(change.since_s, self._change_since(change.since_s))
        if self.calm >= CALM:
            self.change = None
        elif at_s - change.since_s >= ADOPTED_S:
            self.change, self.seen, self.newest = None, 0, []

    def _change_since(self, since_s: float) -> float:
        later = [value for at_s, value in self.newest if at_s >= since_s]
        return median(later or [value for _, value in self.newest]) - self.usual


_STATE = TypeAdapter(ChangeDetector)
