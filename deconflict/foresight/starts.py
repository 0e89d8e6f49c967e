"""When a robot that stands, and says that it goes at once, starts: learned by kind of forecast and time stood.

Robots that wait their turn, are stalled or stand before another robot tell paths as if they went at once. How many of
those that have stood so long start in the next second is counted by kind, faded by a half in `HALF_LIFE_S`, and drawn
towards that of all kinds where a kind has few cases (a piecewise constant hazard with a gamma prior).
"""

from dataclasses import dataclass, field

import numpy as np

from deconflict.learned import Part, numbers
from ingest.seam import Floats, Ints

STOOD_S: Floats = np.array([0.0, 1.5, 3.0, 5.0, 10.0, 20.0, 40.0])
"""Lower ends of the bins of the time stood."""
PRIOR_PER_S: Floats = np.array([0.45, 0.35, 0.25, 0.18, 0.1, 0.06, 0.03])
"""Starts a second of a kind that nothing is known of."""
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
class Starts:
    """Starts and seconds of standing, by kind and time stood."""

    counts: Floats = field(default_factory=lambda: np.zeros((0, len(STOOD_S), 2)))
    """(kinds, bins, 2) starts, and seconds during which a robot might have started."""
    as_of_s: float | None = None

    def take(self, kind: Ints, stood_s: Floats, lasted_s: Floats, started: Floats, now_s: float) -> None:
        """Take in n robots that had stood `stood_s` (n,) and said that they went: whether they `started` (n,) within
        the next `lasted_s` (n,)."""
        if not len(kind):
            return
        self._room(int(kind.max()) + 1)
        self.counts *= 0.5 ** (max(now_s - (self.as_of_s or now_s), 0.0) / HALF_LIFE_S)
        self.as_of_s = now_s
        bins = _bin(stood_s)
        cases = np.column_stack([started, np.where(started > 0, lasted_s / 2, lasted_s)])
        for row, (of_kind, of_bin) in enumerate(zip(kind.tolist(), bins.tolist(), strict=True)):
            self.counts[of_kind, of_bin] += cases[row]

    def per_s(self, kind: Ints) -> Floats:
        """(n, bins) starts a second of kinds (n,)."""
        self._room(int(kind.max()) + 1 if len(kind) else 0)
        total = self.counts.sum(axis=0)
        overall = (total[:, 0] + PRIOR_S * PRIOR_PER_S) / (total[:, 1] + PRIOR_S)
        of_kind = self.counts[kind]
        per_s: Floats = (of_kind[..., 0] + SHRUNK_S * overall) / (of_kind[..., 1] + SHRUNK_S)
        return per_s

    def weights(self, kind: Ints, stood_s: Floats) -> Floats:
        """(n, len(LATE_S)) how likely robots of kinds (n,) that have stood `stood_s` (n,) start so late."""
        per_s, rows = self.per_s(kind), np.arange(len(kind))[:, None]
        until_edge = np.concatenate([np.zeros((len(kind), 1)), np.cumsum(per_s[:, :-1] * np.diff(STOOD_S), axis=1)], 1)
        times_s = np.maximum(stood_s, 0.0)[:, None] + np.concatenate([[0.0], _UNTIL_S])
        bins = _bin(times_s)
        hazard = until_edge[rows, bins] + per_s[rows, bins] * (times_s - STOOD_S[bins])
        stays = np.concatenate([np.exp(hazard[:, :1] - hazard), np.zeros((len(kind), 1))], axis=1)
        weights: Floats = stays[:, :-1] - stays[:, 1:]
        return weights

    def learned(self) -> Part:
        """What is worth keeping over a restart."""
        return {"counts": self.counts, "as_of_s": self.as_of_s}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` gave. Raises `UnreadableError`."""
        if part:
            self.counts = numbers(part, "counts", (None, len(STOOD_S), 2))
            self.as_of_s = None if part.get("as_of_s") is None else float(numbers(part, "as_of_s", ()))

    def _room(self, kinds: int) -> None:
        more = kinds - len(self.counts)
        if more > 0:
            self.counts = np.concatenate([self.counts, np.zeros((more, *self.counts.shape[1:]))])


def _bin(stood_s: Floats) -> Ints:
    return np.searchsorted(STOOD_S, stood_s, side="right") - 1
