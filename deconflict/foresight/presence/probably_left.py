"""Silences that last: how likely each silent robot is still present, and which have probably left."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from deconflict.foresight.presence.silence_outcomes import SilenceCase
from ingest.batch import Floats
from ingest.measures.measures import Labels

PROBABLY_LEFT = 0.5
"""A robot has probably left if the probability that it is present is lower than this."""


@dataclass(slots=True, eq=False)
class PresenceChanges:
    """What changed of silent robots since the last step."""

    there: dict[str, float] = field(default_factory=dict)
    """The probability that each is present now, by UUID. Includes robots that have reported since, or are gone."""
    silent: set[str] = field(default_factory=set)
    """Robots that have fallen silent."""
    stopped: list[str] = field(default_factory=list)
    """Silent robots that stood although they sent a path: they are believed to stand there still."""
    left: list[str] = field(default_factory=list)
    """Robots that have probably left by now."""
    back: list[str] = field(default_factory=list)
    """Robots that had probably left and now seem to be present, although they have not reported."""


@dataclass(slots=True, eq=False)
class LastingSilence:
    """The silence of one robot."""

    heard_s: float
    """When the robot was last heard."""
    grace_s: float
    """How long the robot may say nothing before it counts as silent."""
    vendor: str
    stood: bool
    """Whether the robot stood when it was last heard."""
    case: SilenceCase | None
    """None for a robot that surely stays."""
    counts: bool
    """Whether its outcome is learned. False if the silence was already long when this process first saw it, as an
    earlier one has learned from it."""
    there: float = 1.0
    """The probability that the robot is present."""


class LastingSilences:
    """All lasting silences, by robot."""

    def __init__(self) -> None:
        self.silences: dict[str, LastingSilence] = {}
        self.fading: dict[str, float] = {}
        """The probability that a robot is still present, of robots for which it is below 1."""
        self.left = Counter[Labels]()
        """By vendor, how many robots have probably left."""
        self.changes = PresenceChanges()
        """Since the last `take_changes`."""

    def begin(self, uuid: str, silence: LastingSilence) -> None:
        """A robot has fallen silent."""
        self.silences[uuid] = silence
        self.changes.silent.add(uuid)

    def end(self, uuid: str) -> LastingSilence | None:
        """End the silence of a robot. None if it was not silent."""
        silence = self.silences.get(uuid)
        if silence:
            self._count(silence, 1.0)
            del self.silences[uuid]
            if self.fading.pop(uuid, None) is not None:
                self.changes.there[uuid] = 1.0
        return silence

    def set_there(self, uuid: str, there: float) -> None:
        """Set the probability that a silent robot is present."""
        silence = self.silences[uuid]
        if change := self._count(silence, there):
            (self.changes.left if change > 0 else self.changes.back).append(uuid)
        silence.there = self.changes.there[uuid] = self.fading[uuid] = there

    def there(self, uuid: str) -> float:
        """The probability that a robot is present; 1 for a robot that is heard."""
        return self.fading.get(uuid, 1.0)

    def has_probably_left(self, uuid: str) -> bool:
        """Whether a robot has probably left."""
        return self.there(uuid) < PROBABLY_LEFT

    def _count(self, silence: LastingSilence, there: float) -> int:
        """Update the count of robots that have probably left. Returns the change: 1, 0 or -1."""
        change = (there < PROBABLY_LEFT) - (silence.there < PROBABLY_LEFT)
        self.left[silence.vendor,] += change
        return change

    def take_changes(self) -> PresenceChanges:
        """What has changed since the last call."""
        changes, self.changes = self.changes, PresenceChanges()
        return changes

    def both_there(self, pairs: Sequence[tuple[str, str]]) -> Floats:
        """(n,) the probability that both robots of each pair are present."""
        if not self.fading:
            return np.ones(len(pairs))
        there = self.fading.get
        return np.array([there(a, 1.0) * there(b, 1.0) for a, b in pairs], np.float64)
