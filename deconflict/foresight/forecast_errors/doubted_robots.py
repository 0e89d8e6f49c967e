"""Which robots move otherwise than they announce, for long enough to name them to people.

A contradiction comes and goes with single reports. What a robot is named for is steady.
"""

import numpy as np

from deconflict.sweep.robot_slots import lengthen
from ingest.batch import Basis, Batch, Bools, Ints

NAMED_AFTER_S = 10.0
"""A robot is named once all of its reports over this time contradicted it."""
KEPT_S = 30.0
"""It is named until this time after the last one."""
ANNOUNCED = (Basis.PATH, Basis.ORDER)
"""Bases of forecasts that a robot states itself. Who announces nothing cannot move otherwise."""


class DoubtedRobots:
    """By slot, since when and until when each robot contradicted what it announced."""

    def __init__(self) -> None:
        self._since_s = np.zeros(0)
        """inf if it did not."""
        self._last_s = np.zeros(0)

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        before = len(self._since_s)
        if slots > before:
            lengthen(self, ("_since_s", "_last_s"), slots - before)
            self.forget(np.arange(before, slots))

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        self._since_s[slots], self._last_s[slots] = np.inf, -np.inf

    def note(self, slots: Ints, batch: Batch, contradict: Bools) -> None:
        """Robots of these slots have reported, in this batch as they announced it; (n,) which contradict that. Nobody
        on foot is doubted."""
        announces = np.isin(batch.basis, ANNOUNCED) & (np.array(batch.participants) != "person")
        since_s, last_s = self._since_s[slots], self._last_s[slots]
        were_named = self._are_named(slots, batch.now_s)
        since_s[batch.now_s - last_s > KEPT_S] = np.inf
        since_s = np.where(contradict, np.minimum(since_s, batch.now_s), np.where(were_named, since_s, np.inf))
        self._since_s[slots] = np.where(announces, since_s, np.inf)
        self._last_s[slots] = np.where(contradict & announces, batch.now_s, last_s)

    def named(self, now_s: float) -> Ints:
        """The slots of the robots to name."""
        return np.flatnonzero(self._are_named(slice(None), now_s))

    def _are_named(self, slots: Ints | slice, now_s: float) -> Bools:
        last_s = self._last_s[slots]
        return (last_s - self._since_s[slots] >= NAMED_AFTER_S) & (now_s - last_s <= KEPT_S)
