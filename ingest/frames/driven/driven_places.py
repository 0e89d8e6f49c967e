"""Where robots drive, and in which direction: driven metres by cell and direction, not the reports themselves."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import hypot
from typing import Self

import numpy as np

from ingest.batch import Floats, Ints

STEP_M = 1.0
"""Directions are taken over this length: noise of positions turns shorter steps."""
SILENT_S, JUMP_M = 5.0, 6.0
"""Between two reports farther apart than this it is unknown where the robot drove."""
EVERY_M = 0.25
"""Points along a step."""
CELL_M, SECTORS = 0.25, 16
MOST_PLACES = 200_000
"""Where more are driven, those driven least are left out."""
WAITING_STEPS = 4096
FARTHEST_CELL = 1 << 28


@dataclass(frozen=True, slots=True, eq=False)
class DrivenPlaces:
    """n places, each driven in one direction."""

    points_m: Floats
    """(n, 2)"""
    headings: Floats
    """(n, 2) unit vectors."""
    metres: Floats
    """(n,) how many metres were driven there."""

    def __len__(self) -> int:
        return len(self.metres)

    @classmethod
    def of_sums(cls, sums: Floats) -> Self:
        """`sums` (n, 5): metres, and the sums of x, y and both components of the heading, weighted by metres."""
        metres, headings = sums[:, 0], sums[:, 3:]
        length = np.maximum(np.hypot(headings[:, 0], headings[:, 1]), 1e-9)
        return cls(sums[:, 1:3] / metres[:, None], headings / length[:, None], metres)

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        points, headings, metres = zip(*((part.points_m, part.headings, part.metres) for part in parts), strict=True)
        return cls(np.concatenate(points), np.concatenate(headings), np.concatenate(metres))

    def coarser(self, cell_m: float) -> Self:
        """The same with cells of this size."""
        keys = _keys(self.points_m, self.headings, cell_m)
        sums = np.column_stack([np.ones(len(self)), self.points_m, self.headings]) * self.metres[:, None]
        return type(self).of_sums(_added(keys, sums)[1])

    def some(self, most: int) -> Self:
        """At most so many of the places, chosen evenly."""
        rows = np.unique(np.linspace(0, len(self) - 1, most).astype(np.int64))
        return type(self)(self.points_m[rows], self.headings[rows], self.metres[rows])

    def placed(self, matrix: Floats, shift_m: Floats) -> Self:
        """In another frame. `matrix` (2, 2) keeps or mirrors lengths, or has one scale."""
        headings = self.headings @ matrix.T
        scale = float(np.hypot(*matrix[:, 0]))
        return type(self)(self.points_m @ matrix.T + shift_m, headings / scale, self.metres * scale)


def _keys(points_m: Floats, headings: Floats, cell_m: float) -> Ints:
    cells = np.clip(np.floor(points_m / cell_m), -FARTHEST_CELL, FARTHEST_CELL).astype(np.int64) + FARTHEST_CELL
    turn = np.arctan2(headings[:, 1], headings[:, 0]) / (2 * np.pi)
    sector = np.rint(turn * SECTORS).astype(np.int64) % SECTORS
    return (cells[:, 0] * (2 * FARTHEST_CELL + 1) + cells[:, 1]) * SECTORS + sector


def _added(keys: Ints, sums: Floats) -> tuple[Ints, Floats]:
    """The distinct keys, and the sums of the rows of each."""
    distinct, row = np.unique(keys, return_inverse=True)
    columns = [np.bincount(row, column, len(distinct)) for column in sums.T]
    return distinct, np.column_stack(columns)


class DrivenPlacesSum:
    """Adds up driven places from the positions of robots."""

    def __init__(self) -> None:
        self._from: dict[str, tuple[float, float, float, float, float]] = {}
        """By robot: where its present step began, then its newest time and position."""
        self._steps: list[tuple[float, float, float, float]] = []
        self._keys, self._sums = np.empty(0, np.int64), np.empty((0, 5))

    def add(self, robot: str, t_s: float, x_m: float, y_m: float) -> None:
        """A robot is here. Times of a robot increase."""
        begin = self._from.get(robot)
        if begin is None or t_s - begin[2] > SILENT_S or hypot(x_m - begin[3], y_m - begin[4]) > JUMP_M:
            self._from[robot] = x_m, y_m, t_s, x_m, y_m
            return
        start_x, start_y = begin[:2]
        if hypot(x_m - start_x, y_m - start_y) >= STEP_M:
            self._steps.append((start_x, start_y, x_m, y_m))
            start_x, start_y = x_m, y_m
            if len(self._steps) >= WAITING_STEPS:
                self._take_in()
        self._from[robot] = start_x, start_y, t_s, x_m, y_m

    def places(self) -> DrivenPlaces:
        self._take_in()
        return DrivenPlaces.of_sums(self._sums)

    def _take_in(self) -> None:
        if not self._steps:
            return
        steps = np.array(self._steps)
        self._steps.clear()
        way = steps[:, 2:] - steps[:, :2]
        length_m = np.hypot(way[:, 0], way[:, 1])
        pieces = np.ceil(length_m / EVERY_M).astype(np.int64)
        row = np.repeat(np.arange(len(steps)), pieces)
        number = np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        points = steps[row, :2] + way[row] * ((number + 0.5) / pieces[row])[:, None]
        headings, metres = (way / length_m[:, None])[row], (length_m / pieces)[row]
        sums = np.column_stack([np.ones(len(row)), points, headings]) * metres[:, None]
        keys = np.concatenate([self._keys, _keys(points, headings, CELL_M)])
        self._keys, self._sums = _added(keys, np.concatenate([self._sums, sums]))
        if len(self._keys) > MOST_PLACES:
            kept = np.sort(np.argpartition(self._sums[:, 0], -MOST_PLACES)[-MOST_PLACES:])
            self._keys, self._sums = self._keys[kept], self._sums[kept]
