"""When a robot that stands, and says that it goes at once, starts: learned by kind of forecast and time stood.

Robots that wait their turn, are stalled or stand before another robot tell paths as if they went at once. How many of
those that have stood so long start in the next second is counted by kind, apart for those that another robot is in
front of, faded by a half in `HALF_LIFE_S`, and drawn towards that of all kinds where a kind has few cases (a piecewise
constant hazard with a gamma prior).
"""

from dataclasses import dataclass, field

import numpy as np

from deconflict.runtime.learned_state import Part, numbers
from ingest.batch import Bools, Floats, Ints

STOOD_S: Floats = np.array([0.0, 1.5, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 40.0])
"""Lower ends of the bins of the time stood."""
PRIOR_PER_S: Floats = np.array(
    [[0.25, 0.2, 0.18, 0.18, 0.15, 0.15, 0.15, 0.1, 0.06], [0.08, 0.05, 0.04, 0.04, 0.04, 0.08, 0.1, 0.08, 0.05]]
)
"""(2, bins) starts a second of a kind that nothing is known of: where the way is free, and where another is in it."""
PRIOR_S = 30.0
"""Seconds of standing that the prior counts as."""
SHRUNK_S = 20.0
"""Seconds of standing that all kinds together count as, of one kind."""
LATE_S: Floats = np.array([0.0, 1.0, 2.0, 4.0, 7.0, 30.0])
"""Delays that stand for all: none, and four, and that the robot stays for the horizon."""
_UNTIL_S: Floats = np.array([0.5, 1.5, 3.0, 5.5, 10.0])
"""Delays up to these are taken for the first of `LATE_S`, and so on."""
HALF_LIFE_S = 6 * 3600.0


@dataclass(slots=True, eq=False)
class StartTimes:
    """StartTimes and seconds of standing, by kind and time stood."""

    counts: Floats = field(default_factory=lambda: np.zeros((0, 2, len(STOOD_S), 2)))
    """(kinds, 2, bins, 2) starts, and seconds during which a robot might have started, by whether it was blocked."""
    as_of_s: float | None = None

    def record(
        self, kind: Ints, blocked: Bools, stood_s: Floats, lasted_s: Floats, started: Floats, now_s: float
    ) -> None:
        """Take in n robots that had stood `stood_s` (n,) and said that they went: whether they `started` (n,) within
        the next `lasted_s` (n,)."""
        if not len(kind):
            return
        self._room(int(kind.max()) + 1)
        self.counts *= 0.5 ** (max(now_s - (self.as_of_s or now_s), 0.0) / HALF_LIFE_S)
        self.as_of_s = now_s
        bins = _bin(stood_s)
        cases = np.column_stack([started, np.where(started > 0, lasted_s / 2, lasted_s)])
        np.add.at(self.counts, (kind, blocked.astype(np.int64), bins), cases)

    def per_s(self, kind: Ints, blocked: Bools) -> Floats:
        """(n, bins) starts a second of robots of kinds (n,)."""
        self._room(int(kind.max()) + 1 if len(kind) else 0)
        side = blocked.astype(np.int64)
        total = self.counts.sum(axis=0)
        overall = (total[..., 0] + PRIOR_S * PRIOR_PER_S) / (total[..., 1] + PRIOR_S)
        of_kind = self.counts[kind, side]
        per_s: Floats = (of_kind[..., 0] + SHRUNK_S * overall[side]) / (of_kind[..., 1] + SHRUNK_S)
        return per_s

    def weights(self, kind: Ints, blocked: Bools, stood_s: Floats) -> Floats:
        """(n, len(LATE_S)) how likely robots of kinds (n,) that have stood `stood_s` (n,) start so late."""
        per_s = self.per_s(kind, blocked)
        times_s = np.maximum(stood_s, 0.0)[:, None] + np.concatenate([[0.0], _UNTIL_S])
        hazard = _hazard(per_s, times_s)
        stays = np.concatenate([np.exp(hazard[:, :1] - hazard), np.zeros((len(kind), 1))], axis=1)
        weights: Floats = stays[:, :-1] - stays[:, 1:]
        return weights

    def late_s(self, kind: Ints, stood_s: Floats, part: Floats) -> Floats:
        """(k, n) how late robots of kinds (n,) whose way is free start, at those parts (k, n) of the distribution."""
        per_s, stood_s = self.per_s(kind, np.zeros(len(kind), np.bool_)), np.maximum(stood_s, 0.0)
        wanted = _hazard(per_s, stood_s[:, None])[:, 0] - np.log1p(-part)
        before, rows = _before(per_s), np.arange(len(kind))
        bins = (wanted[:, :, None] >= before[:, 1:]).sum(axis=2)
        late_s: Floats = STOOD_S[bins] + (wanted - before[rows, bins]) / per_s[rows, bins] - stood_s
        return late_s

    def learned(self) -> Part:
        """What is worth keeping over a restart."""
        return {"by_blocked": self.counts, "as_of_s": self.as_of_s}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` gave. Raises `UnreadableError`."""
        if "by_blocked" in part:
            self.counts = numbers(part, "by_blocked", (None, 2, len(STOOD_S), 2))
            self.as_of_s = None if part.get("as_of_s") is None else float(numbers(part, "as_of_s", ()))

    def _room(self, kinds: int) -> None:
        more = kinds - len(self.counts)
        if more > 0:
            self.counts = np.concatenate([self.counts, np.zeros((more, *self.counts.shape[1:]))])


def _before(per_s: Floats) -> Floats:
    """(n, bins) cumulative hazard at the lower end of each bin."""
    return np.concatenate([np.zeros((len(per_s), 1)), np.cumsum(per_s[:, :-1] * np.diff(STOOD_S), axis=1)], axis=1)


def _hazard(per_s: Floats, stood_s: Floats) -> Floats:
    """(n, k) cumulative hazard when robots have stood so long (n, k)."""
    rows, bins = np.arange(len(per_s))[:, None], _bin(stood_s)
    hazard: Floats = _before(per_s)[rows, bins] + per_s[rows, bins] * (stood_s - STOOD_S[bins])
    return hazard


def _bin(stood_s: Floats) -> Ints:
    return np.searchsorted(STOOD_S, stood_s, side="right") - 1
