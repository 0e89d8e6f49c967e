"""When a robot starts that stands although its forecast says that it goes at once: learned by kind of forecast and by
time stood.

Robots that wait their turn, are stalled, or stand before another robot send paths as if they went at once. Of the
robots that have stood for the same time, the share that starts in the next second is counted by kind, and separately
for those that another robot blocks. Counts fade by a half in `HALF_LIFE_S`. The rate of a kind with few cases is drawn
towards that of all kinds (a piecewise constant hazard with a gamma prior).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from deconflict.foresight.forecast_errors.error_ledger import ForecastKind
from deconflict.runtime.learned_state import count_column
from ingest.batch import Bools, Floats, Ints

STOOD_S: Floats = np.array([0.0, 1.5, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 40.0])
"""Lower ends of the bins of the time stood."""
PRIOR_PER_S: Floats = np.array(
    [[0.25, 0.2, 0.18, 0.18, 0.15, 0.15, 0.15, 0.1, 0.06], [0.08, 0.05, 0.04, 0.04, 0.04, 0.08, 0.1, 0.08, 0.05]]
)
"""(2, bins) starts a second of a kind without cases: of robots whose way is free, and of blocked robots."""
PRIOR_S = 30.0
"""The prior counts as this many seconds of standing."""
SHRUNK_S = 20.0
"""All kinds together count as this many seconds of standing of one kind."""
LATE_S: Floats = np.array([0.0, 1.0, 2.0, 4.0, 7.0, 30.0])
"""Delays that stand for all others: no delay, four delays, and one by which the robot stays for the horizon."""
_UNTIL_S: Floats = np.array([0.0, 0.5, 1.5, 3.0, 5.5, 10.0])
"""Delays from the first of these to the second count as the first of `LATE_S`, and so on."""
_LASTS_S: Floats = np.diff(STOOD_S)
"""Lengths of all bins of `STOOD_S` but the last."""
HALF_LIFE_S = 6 * 3600.0
COUNTS = count_column("kinds", 2, len(STOOD_S), 2)

CountsForAll = Callable[[str], bool]
"""Whether what is learned of a vendor counts for all vendors."""


def always(_vendor: str) -> bool:
    return True


@dataclass(slots=True, eq=False)
class StartTimes:
    """Starts and seconds of standing, by kind and time stood."""

    kinds: Mapping[ForecastKind, int] = field(default_factory=dict)
    """The row of each kind, which a ledger of errors gives."""
    counts_for_all: CountsForAll = always
    counts: Floats = field(default_factory=lambda: np.zeros((0, 2, len(STOOD_S), 2)))
    """(kinds, 2, bins, 2) starts, and seconds in which a robot could have started, faded. The second axis is whether
    the robot was blocked."""
    as_of_s: float | None = None
    """When the counts were last faded; None before the first time."""

    def record(
        self, kind: Ints, blocked: Bools, stood_s: Floats, lasted_s: Floats, started: Floats, now_s: float
    ) -> None:
        """Count n robots that had stood for `stood_s` (n,) although their forecasts said that they go: whether each
        `started` (n,) within the next `lasted_s` (n,)."""
        if not len(kind):
            return
        self._make_room(int(kind.max()) + 1)
        self.counts *= 0.5 ** (max(now_s - (self.as_of_s or now_s), 0.0) / HALF_LIFE_S)
        self.as_of_s = now_s
        bins = _bin(stood_s)
        cases = np.column_stack([started, np.where(started > 0, lasted_s / 2, lasted_s)])
        np.add.at(self.counts, (kind, blocked.astype(np.int64), bins), cases)

    def per_s(self, kind: Ints, blocked: Bools) -> Floats:
        """(n, bins) starts a second of robots of these kinds (n,)."""
        self._make_room(int(kind.max()) + 1 if len(kind) else 0)
        side = blocked.astype(np.int64)
        total = self.counts[self._rows_for_all()].sum(axis=0)
        overall = (total[..., 0] + PRIOR_S * PRIOR_PER_S) / (total[..., 1] + PRIOR_S)
        of_kind = self.counts[kind, side]
        return (of_kind[..., 0] + SHRUNK_S * overall[side]) / (of_kind[..., 1] + SHRUNK_S)

    def weights(self, kind: Ints, blocked: Bools, stood_s: Floats) -> Floats:
        """(n, len(LATE_S)) the probability of each delay of `LATE_S`, for robots of these kinds (n,) that have stood
        for `stood_s` (n,)."""
        per_s = self.per_s(kind, blocked)
        hazard = _hazard(per_s, _before(per_s), np.maximum(stood_s, 0.0)[:, None] + _UNTIL_S)
        stays = np.zeros((len(kind), len(LATE_S) + 1))
        stays[:, :-1] = np.exp(hazard[:, :1] - hazard)
        return stays[:, :-1] - stays[:, 1:]

    def late_s(self, kind: Ints, stood_s: Floats, part: Floats) -> Floats:
        """(k, n) the delays of robots of these kinds (n,) whose way is free, at these parts (k, n) of the
        distribution."""
        per_s, stood_s = self.per_s(kind, np.zeros(len(kind), np.bool_)), np.maximum(stood_s, 0.0)
        before, rows = _before(per_s), np.arange(len(kind))
        wanted = _hazard(per_s, before, stood_s[:, None])[:, 0] - np.log1p(-part)
        bins = (wanted[:, :, None] >= before[:, 1:]).sum(axis=2)
        return STOOD_S[bins] + (wanted - before[rows, bins]) / per_s[rows, bins] - stood_s

    def restore(self, kind: Ints, counts: Floats, as_of_s: float | None) -> None:
        """Go on with what `of_kinds` gave of these kinds (n,)."""
        self._make_room(int(kind.max(initial=-1)) + 1)
        self.counts[kind], self.as_of_s = counts, as_of_s

    def of_kinds(self, kind: Ints) -> Floats:
        """(n, 2, bins, 2) the counts of these kinds (n,)."""
        self._make_room(int(kind.max(initial=-1)) + 1)
        return self.counts[kind]

    def _rows_for_all(self) -> Bools:
        """(kinds,) the kinds that count for all."""
        counts = np.ones(len(self.counts), np.bool_)
        for kind, row in self.kinds.items():
            if row < len(counts):
                counts[row] = self.counts_for_all(kind.vendor)
        return counts

    def _make_room(self, kinds: int) -> None:
        more = kinds - len(self.counts)
        if more > 0:
            self.counts = np.concatenate([self.counts, np.zeros((more, *self.counts.shape[1:]))])


def _before(per_s: Floats) -> Floats:
    """(n, bins) cumulative hazard at the lower end of each bin."""
    before = np.zeros_like(per_s)
    np.cumsum(per_s[:, :-1] * _LASTS_S, axis=1, out=before[:, 1:])
    return before


def _hazard(per_s: Floats, before: Floats, stood_s: Floats) -> Floats:
    """(n, k) cumulative hazard of robots that have stood for times (n, k); for `before` see `_before`."""
    rows, bins = np.arange(len(per_s))[:, None], _bin(stood_s)
    return before[rows, bins] + per_s[rows, bins] * (stood_s - STOOD_S[bins])


def _bin(stood_s: Floats) -> Ints:
    return np.searchsorted(STOOD_S, stood_s, side="right") - 1
