"""Crossings as robots show them: where ways lead through both along and across.

The first and the last metres of a trip do not count, so that the mouth of a bay is no crossing.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, label

from deconflict.simulation.driving.crossings import (
    AFTER_M,
    BEFORE_M,
    CrossingPassage,
    Direction,
    passage_of,
)
from deconflict.simulation.driving.routes import Drive
from deconflict.simulation.floor_layout import Place
from metrics.whatif.roads import CELL_M, FloorWay, sampled_way

ENDS_M = 4.5
LEAST_WAYS = 3
"""Ways along and ways across that a crossing needs."""
WIDEST_M = 6.0
"""Larger areas where ways cross are open floor, without an order."""
THROUGH_M = 1.4
"""A way that passes the middle of a crossing at this distance or less leads through it."""


@dataclass(frozen=True, slots=True)
class RoadCrossing:
    """A crossing."""

    middle: Place
    floor: int


def road_crossings(ways: Sequence[FloorWay]) -> list[RoadCrossing]:
    """The crossings of all floors."""
    return [
        RoadCrossing(middle, floor)
        for floor in sorted({way.floor for way in ways})
        for middle in _middles([np.array(way.corners) for way in ways if way.floor == floor])
    ]


def _middles(ways: Iterable[np.ndarray]) -> list[Place]:
    trim = round(ENDS_M / 0.2)
    inner = [sampled[trim:-trim] for way in ways if len(sampled := sampled_way(way)) > 2 * trim + 2]
    if not inner:
        return []
    points = np.vstack(inner)
    low_m, high_m = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    counts = np.zeros((2, *np.ceil((high_m - low_m) / CELL_M).astype(int)))
    for way in inner:
        across = np.abs(np.diff(way[:, 1])) > np.abs(np.diff(way[:, 0]))
        x, y = ((way[:-1] - low_m) / CELL_M).astype(int).T
        for axis in range(2):
            cells = np.unique(np.column_stack([x, y])[across == bool(axis)], axis=0)
            counts[axis, cells[:, 0], cells[:, 1]] += 1
    both = np.all(counts >= LEAST_WAYS, axis=0)
    areas, count = label(binary_dilation(both, np.ones((3, 3))), np.ones((3, 3)))
    found = []
    for area in range(1, count + 1):
        cells = np.argwhere((areas == area) & both)
        if np.all(np.ptp(cells, axis=0) * CELL_M <= WIDEST_M):
            middle = low_m + (cells.min(axis=0) + cells.max(axis=0) + 1) / 2 * CELL_M
            found.append((float(middle[0]), float(middle[1])))
    return found


def drive_passages(drive: Drive, floor: int, crossings: Sequence[RoadCrossing]) -> tuple[CrossingPassage, ...]:
    """The crossings that a drive leads through, in order."""
    found: list[CrossingPassage] = []
    for node, crossing in enumerate(crossings):
        if crossing.floor != floor:
            continue
        away_m = np.maximum(np.abs(drive.x_m - crossing.middle[0]), np.abs(drive.y_m - crossing.middle[1]))
        if away_m.min() > THROUGH_M or away_m[0] < BEFORE_M or away_m[-1] < AFTER_M:
            continue
        nearest = int(np.argmin(away_m))
        enter = int(np.flatnonzero(away_m[:nearest] > BEFORE_M)[-1]) + 1
        leave = nearest + int(np.argmax(away_m[nearest:] > AFTER_M))
        inward, outward = (direction(float(drive.yaw_rad[sample])) for sample in (enter, leave))
        found.append(passage_of(drive, node, (enter, leave), inward, outward))
    found.sort(key=lambda passage: passage.enter_m)
    return tuple(
        passage
        for before, passage in zip([None, *found], found, strict=False)
        if before is None or passage.enter_m >= before.leave_m
    )


def direction(yaw_rad: float) -> Direction:
    """The nearest of the four directions along the axes of the floor."""
    quarter = round(yaw_rad / (np.pi / 2)) % 4
    return ((1, 0), (0, 1), (-1, 0), (0, -1))[quarter]
