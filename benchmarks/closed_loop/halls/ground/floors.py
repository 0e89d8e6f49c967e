"""Halls drawn by seed: racks with narrow aisles, an open hall, rooms behind doors."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.closed_loop.halls.ground.roadmap import NARROW_HALF_M, WIDE_HALF_M, Roadmap, Street, roadmap_of
from ingest.batch import Floats

STUB_M = 3.3
"""From the middle of a street to the bay beside it."""
BORDER_M = 0.4

Area = tuple[float, float, float, float]
"""West, south, east and north, in metres."""


@dataclass(frozen=True)
class Hall:
    kind: str
    streets: list[Street]
    areas: list[Area]
    """Ground beside streets that is free too."""
    robots: int

    def roadmap(self) -> Roadmap:
        return roadmap_of(self.streets)

    def walls(self) -> Floats:
        """(w, 4) centres and half sizes of rectangles that are all ground where no robot may be."""
        free = [*(street.area() for street in self.streets), *self.areas]
        xs = sorted({round(x, 3) for a in free for x in (a[0], a[2])})
        ys = sorted({round(y, 3) for a in free for y in (a[1], a[3])})
        xs, ys = [xs[0] - BORDER_M, *xs, xs[-1] + BORDER_M], [ys[0] - BORDER_M, *ys, ys[-1] + BORDER_M]
        x, y = (np.array(a[:-1]) / 2 + np.array(a[1:]) / 2 for a in (xs, ys))
        solid = np.ones((len(x), len(y)), bool)
        for west, south, east, north in free:
            solid[np.ix_((x > west) & (x < east), (y > south) & (y < north))] = False
        return np.array([_centred(a, xs, ys) for a in _rectangles(solid)])


def _rectangles(solid: Floats) -> list[tuple[int, int, int, int]]:
    """Greedy rectangles of cells that are solid: first and last column, first and last row."""
    left, found = solid.copy(), []
    for column in range(solid.shape[0]):
        row = 0
        while row < solid.shape[1]:
            if not left[column, row]:
                row += 1
                continue
            last = row
            while last + 1 < solid.shape[1] and left[column, last + 1]:
                last += 1
            right = column
            while right + 1 < solid.shape[0] and left[right + 1, row : last + 1].all():
                right += 1
            left[column : right + 1, row : last + 1] = False
            found.append((column, right, row, last))
            row = last + 1
    return found


def _centred(cells: tuple[int, int, int, int], xs: list[float], ys: list[float]) -> tuple[float, float, float, float]:
    west, east, south, north = xs[cells[0]], xs[cells[1] + 1], ys[cells[2]], ys[cells[3] + 1]
    return (west + east) / 2, (south + north) / 2, (east - west) / 2, (north - south) / 2


def _stub(x_m: float, y_m: float, to_x: int, to_y: int) -> Street:
    """A bay beside a street whose middle is at (x_m, y_m)."""
    far = (x_m + to_x * STUB_M, y_m + to_y * STUB_M)
    start, end = sorted([(x_m, y_m), far])
    return Street(start, end, stub=1 if end == far else -1)


def _aisles(rng: np.random.Generator) -> Hall:
    """Two blocks of racks between three main ways."""
    pitch_m, count = 3.8, 9
    width_m = pitch_m * (count + 1)
    lengths_m = rng.uniform(12.0, 24.0, 2)
    mains_m = [0.0, lengths_m[0] + 2 * WIDE_HALF_M, lengths_m.sum() + 4 * WIDE_HALF_M]
    streets = [Street((0.0, y), (width_m, y), wide=True) for y in mains_m]
    streets += [Street((x, 0.0), (x, mains_m[2]), wide=True) for x in (0.0, width_m)]
    for block in range(2):
        low, high = mains_m[block], mains_m[block + 1]
        for k in range(count):
            x = pitch_m * (k + 1)
            places = tuple(
                round(float(f) * (high - low), 2) for f in rng.choice([0.3, 0.42, 0.55, 0.7], 2, replace=False)
            )
            streets.append(Street((x, low), (x, high), stations=tuple(sorted(places))))
    streets += [_stub(pitch_m * (k + 1), y, 0, s) for y, s in ((mains_m[0], -1), (mains_m[2], 1)) for k in range(count)]
    return Hall("aisles", streets, [], 27)


def _open(rng: np.random.Generator) -> Hall:
    """Wide ways that cross, with machines or free ground between them and bays along them."""
    xs, ys = (np.concatenate([[0.0], rng.uniform(11.0, 15.0, 3).cumsum()]) for _ in range(2))
    streets = [Street((0.0, float(y)), (float(xs[-1]), float(y)), wide=True) for y in ys]
    streets += [Street((float(x), 0.0), (float(x), float(ys[-1])), wide=True) for x in xs]
    areas: list[Area] = []
    for i in range(3):
        for k in range(3):
            west, east, south, north = (float(v) for v in (xs[i], xs[i + 1], ys[k], ys[k + 1]))
            if rng.random() < 0.4:
                areas.append((west, south, east, north))
            streets += [
                _stub(west + 0.35 * (east - west), south, 0, 1),
                _stub(west, south + 0.65 * (north - south), 1, 0),
            ]
    for a, b in pairwise(xs):
        at_m = [float(a + share * (b - a)) for share in (0.35, 0.65)]
        streets += [_stub(x, float(y), 0, side) for x in at_m for y, side in ((ys[0], -1), (ys[-1], 1))]
    for a, b in pairwise(ys):
        at_m = [float(a + share * (b - a)) for share in (0.35, 0.65)]
        streets += [_stub(float(x), y, side, 0) for y in at_m for x, side in ((xs[0], -1), (xs[-1], 1))]
    return Hall("open", streets, areas, 26)


def _doors(rng: np.random.Generator) -> Hall:
    """Six rooms, each with a ring of ways, joined by corridors that have a bay at either end."""
    size_m = 12.0
    streets: list[Street] = []
    gap_m = rng.uniform(6.5, 9.0, 2)
    for i in range(3):
        for k in range(2):
            x, y = i * (size_m + gap_m[0]), k * (size_m + gap_m[1])
            x, y = float(x), float(y)
            streets += [Street((x, b), (x + size_m, b), wide=True) for b in (y, y + size_m)]
            streets += [Street((a, y), (a, y + size_m), wide=True) for a in (x, x + size_m)]
            streets += _in_room(x, y, size_m, i, k)
            if i < 2:
                at_m = y + float(rng.choice([4.0, 8.0]))
                streets.append(Street((x + size_m, at_m), (x + size_m + float(gap_m[0]), at_m)))
            if k < 1:
                at_m = x + float(rng.choice([4.0, 8.0]))
                streets.append(Street((at_m, y + size_m), (at_m, y + size_m + float(gap_m[1]))))
    return Hall("doors", streets, [], 25)


def _in_room(x: float, y: float, size_m: float, i: int, k: int) -> list[Street]:
    """Bays of a room: where it has no doors, and inside the ring."""
    found = (
        [_stub(x + at, y, 0, -1) for at in (4.0, 8.0)]
        if k == 0
        else [_stub(x + at, y + size_m, 0, 1) for at in (4.0, 8.0)]
    )
    if i == 0:
        found += [_stub(x, y + at, -1, 0) for at in (4.0, 8.0)]
    if i == 2:
        found += [_stub(x + size_m, y + at, 1, 0) for at in (4.0, 8.0)]
    return [*found, _stub(x, y + 4.0, 1, 0), _stub(x + size_m, y + 8.0, -1, 0)]


KINDS: dict[str, Callable[[np.random.Generator], Hall]] = {"aisles": _aisles, "open": _open, "doors": _doors}


def hall_of(kind: str, seed: int) -> Hall:
    return KINDS[kind](np.random.default_rng([seed, sorted(KINDS).index(kind)]))


__all__ = ["KINDS", "NARROW_HALF_M", "Hall", "hall_of"]
