"""Silences that last, and how likely each robot is still there."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from deconflict.foresight.presence.silence_outcomes import PROBABLY_LEFT, SilenceCase
from ingest.batch import Floats
from ingest.measures.measures import Labels


@dataclass(slots=True, eq=False)
class PresenceChanges:
    """Of silent robots, since the last step."""

    there: dict[str, float] = field(default_factory=dict)
    """How likely each is there now; also those that have reported since, or are gone."""
    silent: set[str] = field(default_factory=set)
    """Those that have fallen silent."""
    stopped: list[str] = field(default_factory=list)
    """Of these, those that stood and told a path: they are believed to stand there still."""
    left: list[str] = field(default_factory=list)
    """Those that have probably left by now."""
    back: list[str] = field(default_factory=list)
    """Those that had probably left, and seem to be there after all, though they have not reported."""


@dataclass(slots=True, eq=False)
class LastingSilence:
    """One that lasts."""

    heard_s: float
    """When the robot was heard last."""
    grace_s: float
    vendor: str
    stood: bool
    """Whether the robot stood when it was heard last."""
    case: SilenceCase | None
    """None for a robot that stays for sure."""
    counts: bool
    """Whether it teaches; one that is first seen when it is long has done so."""
    there: float = 1.0


class LastingSilences:
    """All silences that last, by robot."""

    def __init__(self) -> None:
        self.silences: dict[str, LastingSilence] = {}
        self.fading: dict[str, float] = {}
        """How likely each robot is still there for which that is below 1."""
        self.left = Counter[Labels]()
        """By vendor, robots that have probably left."""
        self.changes = PresenceChanges()
        """Since they were taken."""

    def begin(self, uuid: str, silence: LastingSilence) -> None:
        self.silences[uuid] = silence
        self.changes.silent.add(uuid)

    def end(self, uuid: str) -> LastingSilence | None:
        """The silence of a robot that lasts no more, if there was one."""
        silence = self.silences.get(uuid)
        if silence:
            self._count(silence, 1.0)
            del self.silences[uuid]
            if self.fading.pop(uuid, None) is not None:
                self.changes.there[uuid] = 1.0
        return silence

    def set_there(self, uuid: str, there: float) -> None:
        """A silent robot is so likely there from now on."""
        silence = self.silences[uuid]
        if moved := self._count(silence, there):
            (self.changes.left if moved > 0 else self.changes.back).append(uuid)
        silence.there = self.changes.there[uuid] = self.fading[uuid] = there

    def _count(self, silence: LastingSilence, there: float) -> int:
        """1 where a robot has probably left by now, -1 where it had, else 0; counted."""
        moved = (there < PROBABLY_LEFT) - (silence.there < PROBABLY_LEFT)
        self.left[silence.vendor,] += moved
        return moved

    def take_changes(self) -> PresenceChanges:
        """What has changed since this was asked last."""
        changes, self.changes = self.changes, PresenceChanges()
        return changes

    def both_there(self, pairs: Sequence[tuple[str, str]]) -> Floats:
        """(n,) how likely both robots of each pair are there."""
        if not self.fading:
            return np.ones(len(pairs))
        there = self.fading.get
        return np.array([there(a, 1.0) * there(b, 1.0) for a, b in pairs], np.float64)
