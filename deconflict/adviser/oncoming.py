"""Robots that will drive towards each other on one line, before the first of them is on it."""

from typing import NamedTuple

import numpy as np

from deconflict.adviser.ways import Point
from deconflict.contention.robots.lookahead import STEP_S
from deconflict.contention.robots.robot_table import RobotTable
from ingest.batch import Bools, Floats, Ints

STRIDE_M, REACH_M = 0.6, 20.0
"""Between two points of a way that are looked at, and how far ahead."""
STRAIGHT_ON_M = 6.0
"""A robot that drives where its path ends is assumed to go on so far."""
CELL_M = 1.0
IN_CELL = 6
"""With so many others in a cell a robot is compared at most."""
OPPOSITE = -0.8
"""Cosine of the angle between ways of robots that drive towards each other."""
INSIDE_M = 0.9
"""A robot that is no farther from the line, beyond half its length, is counted as on it."""


class Oncoming(NamedTuple):
    """Two robots that will meet head-on, and what is free of the other before the first is on the line."""

    waits: str
    """UUID of the robot that can still wait before the line."""
    first: str
    """UUID of the robot that is on the line, or comes first."""
    before_m: Point
    """The first point of the line on the way of the one that waits."""
    away_m: float
    """How far that is ahead of it."""
    line_m: Floats
    """(k, 2) the points of the line."""
    is_choice: bool
    """Whether the other could wait as well."""


class _Lines(NamedTuple):
    """The ways of n robots at k points."""

    slots: Ints
    """(n,)"""
    points_m: Floats
    """(n, k, 2), nan beyond their ends."""
    yaw_rad: Floats
    """(n, k)"""
    t_s: Floats
    """(n, k) from now."""


def oncoming(robots: RobotTable, slots: Ints) -> list[Oncoming]:
    """The robots of `slots` that will meet head-on with another vendor's if nobody waits."""
    lines = _lines(robots, slots)
    row, other, mine, theirs = _head_on(robots, lines)
    if not len(row):
        return []
    pair = row * len(lines.slots) + other
    order = np.argsort(pair, kind="stable")
    starts = np.flatnonzero(np.diff(pair[order], prepend=-1))
    ends = np.append(starts[1:], len(order))
    found = []
    for begin, end in zip(starts.tolist(), ends.tolist(), strict=True):
        rows = order[begin:end]
        found.append(_of_pair(robots, lines, (int(row[rows[0]]), int(other[rows[0]])), (mine[rows], theirs[rows])))
    return [each for each in found if each]


def _lines(robots: RobotTable, slots: Ints) -> _Lines:
    records = robots.records[slots]
    here_m = np.stack([records["reported_x_m"], records["reported_y_m"]], axis=1)[:, None]
    points_m = np.concatenate([here_m, robots.ways_m(slots)], axis=1)
    legs = points_m[:, -1] - points_m[:, -2]
    leg_m = np.hypot(*legs.T)[:, None]
    on_m = np.where(leg_m > 0.1, STRAIGHT_ON_M / np.maximum(leg_m, 1e-9), 0.0)
    points_m = np.concatenate([points_m, (points_m[:, -1] + on_m * legs)[:, None]], axis=1)
    gone_m = np.hypot(*np.moveaxis(np.diff(points_m, axis=1), -1, 0)).cumsum(axis=1)
    gone_m = np.concatenate([np.zeros((len(slots), 1)), gone_m], axis=1)
    goes = gone_m[:, -1] > STRIDE_M
    slots, points_m, gone_m = slots[goes], points_m[goes], gone_m[goes]
    along_m = np.arange(0.0, REACH_M, STRIDE_M)
    leg = np.minimum((gone_m[:, None, :] <= along_m[:, None]).sum(axis=2) - 1, gone_m.shape[1] - 2)
    row = np.arange(len(slots))[:, None]
    length_m = np.maximum(gone_m[row, leg + 1] - gone_m[row, leg], 1e-9)
    share = (along_m - gone_m[row, leg]) / length_m
    ways = points_m[row, leg + 1] - points_m[row, leg]
    places_m = points_m[row, leg] + share[..., None] * ways
    places_m[along_m > gone_m[:, -1:]] = np.nan
    return _Lines(slots, places_m, np.arctan2(ways[..., 1], ways[..., 0]), STEP_S * (leg + share))


def _head_on(robots: RobotTable, lines: _Lines) -> tuple[Ints, Ints, Ints, Ints]:
    """Rows of pairs, the smaller first, and the points of both where their bodies would meet head-on."""
    row, point = np.nonzero(np.isfinite(lines.points_m[..., 0]))
    at_m, floor = lines.points_m[row, point], robots.records["floor"][lines.slots[row]]
    pairs = [_in_one_cell(np.floor(at_m / CELL_M + shift).astype(np.int64), floor) for shift in (0.0, 0.5)]
    a, b = np.concatenate(pairs, axis=1)
    a, b = np.where(row[a] < row[b], (a, b), (b, a))
    chosen = _oppose(robots, lines, row, point, a, b)
    a, b = a[chosen], b[chosen]
    return row[a], row[b], point[a], point[b]


def _in_one_cell(cells: Ints, floor: Ints) -> Ints:
    """(2, p) pairs of entries whose cells, (n, 2), and floors are the same."""
    key = (floor * 2_000_003 + cells[:, 0]) * 2_000_003 + cells[:, 1]
    order = np.argsort(key, kind="stable")
    key = key[order]
    found = []
    for off in range(1, IN_CELL + 1):
        same = np.flatnonzero(key[off:] == key[:-off])
        found.append(np.stack([order[same], order[same + off]]))
    return np.concatenate(found, axis=1)


def _oppose(robots: RobotTable, lines: _Lines, row: Ints, point: Ints, a: Ints, b: Ints) -> Bools:
    """Whether robots of two vendors would meet head-on at their points `a` and `b` (p,)."""
    yaw_rad, at_m = lines.yaw_rad[row, point], lines.points_m[row, point]
    opposite = np.cos(yaw_rad[a] - yaw_rad[b]) < OPPOSITE
    off_m = at_m[b] - at_m[a]
    aside_m = np.abs(off_m[:, 1] * np.cos(yaw_rad[a]) - off_m[:, 0] * np.sin(yaw_rad[a]))
    width_m = robots.records["width_m"][lines.slots[row]]
    found: Bools = opposite & (row[a] != row[b]) & (aside_m < (width_m[a] + width_m[b]) / 2)
    return found


def _of_pair(robots: RobotTable, lines: _Lines, rows: tuple[int, int], points: tuple[Ints, Ints]) -> Oncoming | None:
    """None if both are on the line."""
    entries = int(points[0].min()), int(points[1].min())
    slots = [int(lines.slots[row]) for row in rows]
    long_m = [float(robots.records["length_m"][slot]) / 2 for slot in slots]
    inside = [entry * STRIDE_M <= long_m[k] + INSIDE_M for k, entry in enumerate(entries)]
    if all(inside) or robots[robots.uuids[slots[0]]].vendor == robots[robots.uuids[slots[1]]].vendor:
        return None
    comes_s = [float(lines.t_s[row, entry]) for row, entry in zip(rows, entries, strict=True)]
    late = (1 if comes_s[1] >= comes_s[0] else 0) if not any(inside) else 1 - inside.index(True)
    row, entry = rows[late], entries[late]
    line_m = lines.points_m[row, entry : int(points[late].max()) + 1]
    before_m = float(line_m[0, 0]), float(line_m[0, 1])
    uuids = robots.uuids[slots[late]], robots.uuids[slots[1 - late]]
    return Oncoming(*uuids, before_m, entry * STRIDE_M, line_m, not any(inside))
