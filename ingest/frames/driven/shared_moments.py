"""Whether robots of two frames would have stood in each other: by a wrong transform they do, by the true one not.

How often they would by chance is counted with the times of one side shifted.
"""

from dataclasses import dataclass
from math import floor, hypot
from typing import Self

import numpy as np

from ingest.batch import Bools, Floats, Ints
from ingest.frames.driven.driven_places import JUMP_M, SILENT_S

EVERY_S = 1
MOST_MOMENTS = 1_000_000
"""Beyond this every second one is left out."""
MOST_ASKED = 30_000
MOVED_M = 0.2
"""A robot that moved by this within a second moves."""
INSIDE = 0.85
"""Centres nearer than this share of both half widths: two bodies in one place, even with noisy positions."""
SHIFTS_S = tuple(
    sign * by_s for by_s in (23, 37, 53, 61, 71, 83, 97, 109, 127, 139, 151, 167, 181, 199) for sign in (-1, 1)
)
ROUGH_SHIFTS = 7
"""One shift of this many is enough where there are overlaps."""
EPISODE_S = 20
BY_CHANCE = 1e-4
"""So improbable is it at most that robots which do not see each other have so few overlaps: some twenty transforms are
tried."""
FEW_SHARE, REFUTED_SHARE, REFUTED_BY = 0.2, 0.3, 3
"""Of the overlaps that are expected by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Where robots were at whole seconds: n moments."""

    t_s: Ints
    """(n,)"""
    robot: Ints
    """(n,)"""
    points_m: Floats
    """(n, 2)"""
    half_width_m: Floats
    """(n,)"""
    moves: Bools
    """(n,)"""

    def __len__(self) -> int:
        return len(self.t_s)

    def take(self, rows: Ints | Bools) -> Self:
        return type(self)(
            self.t_s[rows], self.robot[rows], self.points_m[rows], self.half_width_m[rows], self.moves[rows]
        )

    def placed(self, matrix: Floats, shift_m: Floats) -> Self:
        return type(self)(self.t_s, self.robot, self.points_m @ matrix.T + shift_m, self.half_width_m, self.moves)

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        first = np.cumsum([0, *(int(part.robot.max(initial=-1)) + 1 for part in parts)])
        robot = np.concatenate([part.robot + begin for part, begin in zip(parts, first, strict=False)])
        rest = [(part.points_m, part.half_width_m, part.moves) for part in parts]
        return cls(np.concatenate([part.t_s for part in parts]), robot, *map(np.concatenate, zip(*rest, strict=True)))


class MomentsSum:
    """Collects moments from the positions of robots."""

    def __init__(self) -> None:
        self._robots: dict[str, int] = {}
        self._before: dict[int, tuple[float, float, float]] = {}
        self._rows: list[tuple[float, ...]] = []
        self._kept = np.empty((0, 6))
        self._every_s = EVERY_S

    def add(self, robot: str, t_s: float, x_m: float, y_m: float, half_width_m: float) -> None:
        """A robot is here. Times of a robot increase."""
        number = self._robots.setdefault(robot, len(self._robots))
        before = self._before.get(number)
        self._before[number] = t_s, x_m, y_m
        if before is None or not 0 < t_s - before[0] <= SILENT_S:
            return
        moved_m = hypot(x_m - before[1], y_m - before[2])
        if moved_m > JUMP_M:
            return
        moves = moved_m > MOVED_M * (t_s - before[0])
        for tick in range(floor(before[0]) + 1, floor(t_s) + 1):
            if tick % self._every_s == 0:
                share = (tick - before[0]) / (t_s - before[0])
                x, y = before[1] + share * (x_m - before[1]), before[2] + share * (y_m - before[2])
                self._rows.append((tick, number, x, y, half_width_m, moves))
        if len(self._rows) >= MOST_MOMENTS // 10:
            self._take_in()

    def moments(self) -> Moments:
        self._take_in()
        kept = self._kept
        whole: Ints = kept[:, :2].astype(np.int64)
        return Moments(whole[:, 0], whole[:, 1], kept[:, 2:4], kept[:, 4], kept[:, 5] > 0)

    def _take_in(self) -> None:
        self._kept = np.concatenate([self._kept, np.array(self._rows).reshape(-1, 6)])
        self._rows.clear()
        while len(self._kept) > MOST_MOMENTS:
            self._every_s *= 2
            self._kept = self._kept[self._kept[:, 0] % self._every_s == 0]


@dataclass(frozen=True, slots=True)
class Overlaps:
    """How often robots of two frames were in one place at one time."""

    found: int
    by_chance: tuple[int, ...]
    """The same with each shift of the times."""

    @property
    def expected(self) -> float:
        return float(np.mean(self.by_chance)) if self.by_chance else 0.0

    @property
    def improbability(self) -> float:
        """How probable it is that there are so few by chance. Meetings come in groups: their spread is measured."""
        from scipy.special import pdtr  # noqa: PLC0415 - only proposals need it

        if not self.by_chance or self.found >= min(self.by_chance):
            return 1.0
        grouped = max(1.0, float(np.var(self.by_chance, ddof=1)) / self.expected)
        return float(pdtr(self.found // grouped, self.expected / grouped))

    @property
    def shows_same_floor(self) -> bool:
        """Far fewer than by chance: these robots give way to each other here."""
        return self.found <= FEW_SHARE * self.expected and self.improbability < BY_CHANCE

    @property
    def refutes(self) -> bool:
        """Many: these robots do not see each other here."""
        return self.found >= max(REFUTED_BY, REFUTED_SHARE * self.expected)


class MomentIndex:
    """The moments of the known robots, to be asked for several transforms."""

    def __init__(self, known: Moments) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415 - only proposals need it

        self._known = known
        self._apart_m = 1000.0
        times = np.unique(known.t_s)
        self._first_s, self._span_s = (int(times[0]), int(np.ptp(times)) + 1) if len(times) else (0, 1)
        self._tree = cKDTree(self._lifted(known.t_s, known.points_m))
        self._half_m = float(known.half_width_m.max(initial=0.0))

    def overlaps(self, own: Moments) -> Overlaps:
        """`own` in the same frame. Each moment of `own` with the nearest known robot of the same second."""
        at = own.t_s - self._first_s
        own = own.take((at >= 0) & (at < self._span_s))
        if len(own) > MOST_ASKED:
            own = own.take(np.random.default_rng(0).choice(len(own), MOST_ASKED, replace=False))
        if not len(own) or not len(self._known):
            return Overlaps(0, ())
        shifts = [by_s for by_s in SHIFTS_S if abs(by_s) < self._span_s / 2]
        found = self._episodes(own, 0)
        shifts = shifts[:: 1 if found < REFUTED_BY else ROUGH_SHIFTS]
        return Overlaps(found, tuple(self._episodes(own, by_s) for by_s in shifts))

    def _episodes(self, own: Moments, by_s: int) -> int:
        """How many meetings, each counted once, if `own` came so much later, around the end to the beginning."""
        t_s = (own.t_s - self._first_s + by_s) % self._span_s + self._first_s
        reach_m = INSIDE * (self._half_m + float(own.half_width_m.max()))
        apart_m, row = self._tree.query(self._lifted(t_s, own.points_m), distance_upper_bound=reach_m)
        near = np.flatnonzero(np.isfinite(apart_m))
        row = row[near]
        inside = apart_m[near] < INSIDE * (own.half_width_m[near] + self._known.half_width_m[row])
        inside &= own.moves[near] | self._known.moves[row]
        near, row = near[inside], row[inside]
        meetings = np.column_stack([own.robot[near], self._known.robot[row], t_s[near] // EPISODE_S])
        return len(np.unique(meetings, axis=0)) if len(meetings) else 0

    def _lifted(self, t_s: Ints, points_m: Floats) -> Floats:
        """Seconds as a third coordinate, so far apart that only the same second is near."""
        return np.column_stack([points_m, self._apart_m * (t_s - self._first_s)])
