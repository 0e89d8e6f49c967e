"""The recorded motion: reported positions joined linearly where two reports are at most 2.1 s apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from ingest.seam import Floats, Forecasts, Ints

JOINED_S = 2.1

_LEG = ("robot", "begin_s", "end_s", "x0", "y0", "yaw0", "x1", "y1", "yaw1", "length", "width", "floor", "since_s")
_COLUMN = {name: column for column, name in enumerate(_LEG)}
_LAST = ("t_s", "x", "y", "yaw", "length", "width", "floor", "since_s", "present_s")


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """Where the r robots that are there at some time of a stretch of s samples are; nan while they are not."""

    first: int
    """The first sample, in steps since the epoch."""
    robot: Ints
    """(r,) index into `Motion.names`, ascending by name of the robot within what `Motion` knows."""
    x_m: Floats
    """(r, s)"""
    y_m: Floats
    yaw_rad: Floats
    half_m: Floats
    """(2, r, s) half length and half width."""
    floor: Floats
    """(r, s)"""
    since_s: Floats
    """(r, s) since when it has been there without a break."""

    @property
    def radius_m(self) -> Floats:
        """(r, s) of the circle around the envelope."""
        radius: Floats = np.hypot(self.half_m[0], self.half_m[1])
        return radius


class Motion:
    """Every robot's newest report, and the legs between reports that have not been looked at yet."""

    def __init__(self) -> None:
        self.names: list[str] = []
        """By index."""
        self.newest_s = -inf
        self._index: dict[str, int] = {}
        self._last = np.empty((0, len(_LAST)))
        self._legs: list[Floats] = []

    def report(self, robots: Sequence[str], forecasts: Forecasts) -> None:
        """Join each robot's first knot to the one before, if it is newer."""
        rows = np.array([self._row(robot) for robot in robots], np.int64)
        first = forecasts.start[:-1]
        here = np.empty((len(rows), 7))
        told = (forecasts.t_s, forecasts.x_m, forecasts.y_m, forecasts.yaw_rad, forecasts.floor)
        for column, values in zip((0, 1, 2, 3, 6), told, strict=True):
            here[:, column] = values[first]
        here[:, 4], here[:, 5] = forecasts.length_m, forecasts.width_m
        newer = here[:, 0] > self._last[rows, 0]
        rows, here = rows[newer], here[newer]
        if not len(rows):
            return
        self.newest_s = max(self.newest_s, float(here[:, 0].max()))
        before = self._last[rows]
        gap_s = here[:, 0] - before[:, 0]
        since_s = np.where(gap_s > JOINED_S, here[:, 0], before[:, 7])
        joined = (gap_s <= JOINED_S) & (here[:, 6] == before[:, 6])
        present_s = before[:, 8] + np.where(joined, gap_s, 0.0)
        begin = np.where(joined[:, None], before[:, :6], here[:, :6])
        legs = (rows, begin[:, 0], here[:, 0], begin[:, 1:4], here[:, 1:4], begin[:, 4:6], here[:, 6], since_s)
        self._legs.append(np.column_stack(legs))
        self._last[rows] = np.column_stack([here, since_s, present_s])

    def last_seen_s(self, robot: str) -> float:
        return float(self._last[self._index[robot], 0]) if robot in self._index else -inf

    def present_s(self) -> dict[str, float]:
        """How long each robot was there."""
        return dict(zip(self.names, self._last[: len(self.names), 8].tolist(), strict=True))

    def stretch(self, first: int, samples: int, step_s: float) -> Stretch:
        """The motion at so many samples from `first` on; forgets what lies before their end."""
        legs = np.concatenate([np.empty((0, len(_LEG))), *self._legs])
        begin, end = legs[:, 1], legs[:, 2]
        low = np.where(begin < end, np.floor(begin / step_s) + 1, np.ceil(end / step_s)).astype(np.int64)
        high = np.floor(end / step_s).astype(np.int64)
        self._legs = [legs[high >= first + samples]]
        low, high = np.maximum(low, first), np.minimum(high, first + samples - 1)
        kept = np.flatnonzero(low <= high)
        legs, low, counts = legs[kept], low[kept], (high - low + 1)[kept]
        leg = np.repeat(np.arange(len(legs)), counts)
        sample = low[leg] + np.arange(len(leg)) - np.repeat(np.cumsum(counts) - counts, counts)
        robot, row = np.unique(legs[:, 0].astype(np.int64), return_inverse=True)
        at = (row[leg], sample - first)
        legs = legs[leg]
        share = _share(legs, sample * step_s)

        def spread(values: Floats) -> Floats:
            there = np.full((len(robot), samples), np.nan)
            there[at] = values
            return there

        yaw0, yaw1 = legs[:, 5], legs[:, 8]
        turn = (yaw1 - yaw0 + np.pi) % (2 * np.pi) - np.pi
        return Stretch(
            first,
            robot,
            spread(legs[:, 3] + share * (legs[:, 6] - legs[:, 3])),
            spread(legs[:, 4] + share * (legs[:, 7] - legs[:, 4])),
            spread(yaw0 + share * turn),
            np.stack([spread(legs[:, 9] / 2), spread(legs[:, 10] / 2)]),
            spread(np.where(legs[:, 11] < 0, np.nan, legs[:, 11])),
            spread(legs[:, 12]),
        )

    def row(self, robot: str) -> int:
        """The index of a robot that has reported."""
        return self._index[robot]

    def pair(self, a: int, b: int) -> tuple[str, str]:
        """The names of two, in ascending order."""
        first, second = sorted((self.names[a], self.names[b]))
        return first, second

    def _row(self, robot: str) -> int:
        row = self._index.get(robot)
        if row is None:
            row = self._index[robot] = len(self.names)
            self.names.append(robot)
            if row == len(self._last):
                more = np.full((max(row, 64), len(_LAST)), -np.inf)
                more[:, 8] = 0.0
                self._last = np.concatenate([self._last, more])
        return row


def _share(legs: Floats, t_s: Floats) -> Floats:
    """How far along each leg `t_s` lies; 0 on one without length."""
    lasts_s = legs[:, 2] - legs[:, 1]
    return (t_s - legs[:, 1]) / np.where(lasts_s > 0, lasts_s, np.inf)
