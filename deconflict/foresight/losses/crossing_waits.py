"""Robots of two vendors that stand before a crossing that is free, each for the other."""

from math import cos, hypot, inf, sin
from typing import Any

from deconflict.foresight.losses.blockers import (
    CROSSES_RAD,
    TOUCHES_M,
    LosingRobot,
    find_blocker,
    half_sides_m,
    way_ahead,
)
from deconflict.foresight.losses.losing import APART_S, RESTS, STANDS_M, KnownRobots, Losing, nearest_rows
from deconflict.foresight.losses.loss import NOBODY
from deconflict.foresight.motion_assumptions import CROSSING_M, CROSSING_S
from deconflict.sweep.geometry.envelope_distances import rectangle_gap
from ingest.batch import Floats
from ingest.frames.angles import turn_between
from ingest.kernels import inner

_turn_between = inner(turn_between)


@inner
def note_standing(robots: KnownRobots, state: Any, slot: int, goes: int) -> None:
    """Update since when a robot stands on its way, by its newest report. `state` is from before it."""
    newest = robots.newest[slot]
    now_s, here = robots.t_s[slot, newest], robots.tracks[slot, newest, 0]
    is_there = hypot(here[0] - state.stood_x_m, here[1] - state.stood_y_m) <= STANDS_M
    if goes == RESTS or not state.known:
        state.stood_s = 0.0
    elif state.stood_s == 0.0 or not is_there or now_s - state.heard_s > APART_S:
        state.stood_s, state.stood_x_m, state.stood_y_m = now_s, here[0], here[1]


@inner
def _has_stood(robots: KnownRobots, states: Losing, slot: int, now_s: float) -> bool:
    """Whether a robot has stood for long before a way that it had said."""
    state = states[slot]
    is_on_way = robots.has_way[slot] and state.is_planned and state.stood_s > 0.0
    return bool(is_on_way and now_s - state.stood_s >= CROSSING_S)


@inner
def _gap_m(robots: KnownRobots, slot: int, pose: Floats, other: int, other_pose: Floats, most_m: float) -> float:
    """How far two robots are apart at two poses (4,); inf if that is more than `most_m`."""
    half, other_half, touch_m = half_sides_m(robots, slot, other)
    dx, dy = other_pose[0] - pose[0], other_pose[1] - pose[1]
    if hypot(dx, dy) > touch_m + most_m:
        return inf
    turn, other_turn = (cos(pose[2]), sin(pose[2])), (cos(other_pose[2]), sin(other_pose[2]))
    return float(rectangle_gap(dx, dy, turn, other_turn, half, other_half))


@inner
def _ways_cross(robots: KnownRobots, slot: int, way: Floats, other: int, other_way: Floats) -> bool:
    """Whether two ways (n, 4) cross where neither robot is now."""
    crosses = False
    for at in range(len(way)):
        for at_other in range(len(other_way)):
            if _gap_m(robots, slot, way[at], other, other_way[at_other], TOUCHES_M) >= TOUCHES_M:
                continue
            if at == 0 or at_other == 0:
                return False
            between_rad = abs(_turn_between(way[at, 2], other_way[at_other, 2]))
            crosses |= CROSSES_RAD[0] < between_rad < CROSSES_RAD[1]
    return crosses


@inner
def _standing_way(robots: KnownRobots, slot: int) -> Floats:
    """(n, 4) the way of a robot that stands, from where it is."""
    here = robots.tracks[slot, robots.newest[slot], 0]
    return way_ahead(robots.ways[slot], here[0], here[1], here[2], CROSSING_M)


@inner
def _is_free(robots: KnownRobots, slot: int, other: int) -> bool:
    """Whether nobody is on the way of a robot that stands for another one."""
    at_s = robots.t_s[slot, robots.newest[slot]]
    losing = LosingRobot(slot, at_s, at_s, 0.0, _standing_way(robots, slot), 0.0, other)
    _, is_on_way = find_blocker(robots, losing)
    return not is_on_way


@inner
def _may_meet(robots: KnownRobots, slot: int, other: int) -> bool:
    """Whether two robots of one floor and height, both heard lately, are of two vendors and near each other."""
    newest, others_newest = robots.newest[slot], robots.newest[other]
    if robots.vendor[slot] == robots.vendor[other]:
        return False
    if abs(robots.t_s[slot, newest] - robots.t_s[other, others_newest]) > APART_S:
        return False
    here, there = robots.tracks[slot, newest, 0], robots.tracks[other, others_newest, 0]
    return bool(hypot(there[0] - here[0], there[1] - here[1]) < 2 * CROSSING_M)


@inner
def mutual_wait(robots: KnownRobots, states: Losing, slot: int) -> int:
    """The nearest robot of another vendor that has long stood before the place where its way and that of this robot
    cross, as this one has; `NOBODY` if there is none, or another robot is in the way."""
    now_s = robots.t_s[slot, robots.newest[slot]]
    if not _has_stood(robots, states, slot, now_s):
        return NOBODY
    way, found = _standing_way(robots, slot), NOBODY
    for other in nearest_rows(robots, slot, way[0, 0], way[0, 1], 2 * CROSSING_M):
        may_meet = _has_stood(robots, states, other, now_s) and _may_meet(robots, slot, other)
        if not may_meet or states[other].blocker not in (NOBODY, slot):
            continue
        if _ways_cross(robots, slot, way, other, _standing_way(robots, other)):
            found = other
            break
    if found == NOBODY or not _is_free(robots, slot, found) or not _is_free(robots, found, slot):
        return NOBODY
    return found
