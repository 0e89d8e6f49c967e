"""Whether something that is measured again and again has changed, since when, and by how much.

A two-sided CUSUM test (Page 1954, Continuous inspection schemes, Biometrika 41) on values less what is usual, over how
much they usually vary. What is usual is learned from the first values and follows the later ones over days, but not
while a change is suspected. A change is over once values are usual again; one that lasts a day is the new usual.
"""

from dataclasses import dataclass, field
from math import sqrt
from statistics import median
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import ConfigDict, Field, TypeAdapter

LEARNED = 15
"""Values that make the first usual one."""
HALF_LIFE_S = 86_400.0
"""In which what is usual goes half the way to what is."""
SLACK, ALARM = 1.0, 16.0
"""A deviation counts beyond so many usual ones; so many in all are an alarm."""
FARTHEST = 4.0
"""A single value counts as no more than so many usual deviations."""
NEWEST = 15
"""Values of which the middle says by how much."""
WORTH = 2.0
"""A change by less than so many usual deviations is none."""
CALM, CALM_WITHIN = 5, 1.5
"""A change is over after so many values in a row within so many usual deviations."""
ADOPTED_S = 86_400.0
"""A change that lasts so long is the new usual."""
UP, DOWN = 0, 1


Sides = Annotated[list[float], Field(min_length=2, max_length=2)]


class LevelChange(NamedTuple):
    """What is no longer as it was."""

    since_s: float
    by: float
    """By how much the level is above what was usual."""


@dataclass(frozen=True, slots=True)
class ChangeLimits:
    """What counts as a change; both in the units of the values."""

    least_spread: float
    """Values are never thought to vary less."""
    least_change: float
    """Less than this is of no interest."""
    rises_only: bool = False


@dataclass(slots=True)
class ChangeDetector:
    """One thing that is measured."""

    __pydantic_config__: ClassVar = ConfigDict(allow_inf_nan=False)
    limits: ChangeLimits
    seen: int = 0
    usual: float = 0.0
    variance: Annotated[float, Field(ge=0)] = 0.0
    at_s: float = 0.0
    """Of the newest value."""
    sums: Sides = field(default_factory=lambda: [0.0, 0.0])
    """Of what the newest values lay above what is usual, and below it, in usual deviations."""
    began_s: Sides = field(default_factory=lambda: [0.0, 0.0])
    """When the values began that each sum is of."""
    newest: Annotated[list[tuple[float, float]], Field(max_length=NEWEST)] = field(default_factory=list)
    """Times and values."""
    change: LevelChange | None = None
    calm: int = 0

    @property
    def spread(self) -> float:
        """The usual deviation."""
        return max(sqrt(self.variance), self.limits.least_spread)

    def add(self, value: float, at_s: float) -> None:
        """One more value, of the time from `at_s` on; times may go back where a clock is set back."""
        self.newest = [*self.newest[1 - NEWEST :], (at_s, value)]
        if self.seen < LEARNED:
            self._begin()
        elif self.change:
            self._follow(value, self.change, at_s)
        else:
            self._test(value, at_s)
        self.at_s = at_s

    def learned(self) -> dict[str, Any]:
        """All of it, JSON-ready."""
        told: dict[str, Any] = _STATE.dump_python(self, mode="json")
        return told

    @classmethod
    def resumed(cls, limits: ChangeLimits, told: object) -> "ChangeDetector":
        """The level that `learned` told. Raises `ValueError`."""
        level = _STATE.validate_python(told)
        level.limits = limits
        return level

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
        by = self._above(since_s)
        if abs(by) >= max(self.limits.least_change, WORTH * self.spread) and (side == UP or not self.limits.rises_only):
            self.change, self.calm = LevelChange(since_s, by), 0

    def _follow(self, value: float, change: LevelChange, at_s: float) -> None:
        usual = abs(value - self.usual) <= max(CALM_WITHIN * self.spread, self.limits.least_change / 2)
        self.calm = self.calm + 1 if usual else 0
        self.change = LevelChange(change.since_s, self._above(change.since_s))
        if self.calm >= CALM:
            self.change = None
        elif at_s - change.since_s >= ADOPTED_S:
            self.change, self.seen, self.newest = None, 0, []

    def _above(self, since_s: float) -> float:
        later = [value for at_s, value in self.newest if at_s >= since_s]
        return median(later or [value for _, value in self.newest]) - self.usual


_STATE = TypeAdapter(ChangeDetector)
