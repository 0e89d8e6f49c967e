"""How much time robots lose between their reports, and which robot is in the way then.

A robot loses what it needs longer than planned from one report to the next. Planned is the shortest time of its recent
forecasts, and of those that it made before it began to lose time: later ones already allow for braking. While it loses
time, it has a blocker (see `blockers`). Once that one has left the way, what the robot loses until it drives as planned
is still because of it. Where nobody is in its way, it may stand for a robot that stands for it (see `crossing_waits`).

`lost_times` is long because it is one loop that passes the state of a robot from step to step.
"""

from math import hypot, inf
from typing import Any

import numpy as np

from deconflict.foresight.losses.blockers import FARTHEST_M, LosingRobot, find_blocker, way_ahead
from deconflict.foresight.losses.crossing_waits import mutual_wait, note_standing
from deconflict.foresight.losses.losing import (
    APART_S,
    GOES,
    KNOWN,
    LOSING_TYPE,
    LOST,
    LOST_TYPE,
    NO_WAY,
    ORDER,
    STANDS_M,
    WAITS,
    KnownRobots,
    Losing,
    LostTimes,
)
from deconflict.foresight.losses.loss import NOBODY
from deconflict.foresight.losses.planned_times import beside_s, planned_s, way_between_m
from deconflict.foresight.losses.usual_times import USUAL, UsualTimes, learn_pass, usual_s
from deconflict.foresight.motion_assumptions import MOVES_MPS
from ingest.batch import Floats, Ints
from ingest.frames.angles import turn_between
from ingest.kernels import CUBES, INTS, READ_FLOATS, copy_rows, inner, kernel

REFERENCES = 5
"""Forecasts from before a robot began to lose time that are kept until it drives as planned."""
CREEPS_MPS = 0.15
"""A robot without a path loses time from when it is slower: it may be slow in a bend, or where it arrives."""
LOSES_SHARE = 0.1
"""A robot loses time if it needs this share of a second longer for each second."""
RISES_MPS = 0.1
"""A robot that becomes faster by this has a free way: its blocker does not change."""
KEEPS_S = 12.0
"""After a blocker was last in the way, it stays the cause for this long."""
BEFORE_S = 2.5
"""What a robot lost this long before its blocker was seen is because of it, too."""
AGAIN_USUAL_S = 5.0
"""A robot drives as usual again this long after it last lost time."""
FASTEST_MPS, FADES = 2.0, 0.999
"""Greatest usual speed, and how much of it is left after a report of a slower robot."""
BENDS_RAD, LOOK_S, BENDS_AHEAD_RAD = 0.25, 3, 1.2
"""A robot drives in a bend if it turns by more than the first from one report to the next, or plans to turn by more
than the last within `LOOK_S`."""
LEAVES_M = 1.0
"""A robot that waits is on its way if its last plan led further than this."""

_turn_between = inner(turn_between)


@inner
def _is_moving(track: Floats) -> bool:
    return hypot(track[-1, 0] - track[0, 0], track[-1, 1] - track[0, 1]) > MOVES_MPS


@inner
def _speeds_mps(robots: KnownRobots, slot: int) -> tuple[float, float]:
    """The speed of a robot until its newest report, and until the report before that."""
    kept, newest = robots.t_s.shape[1], robots.newest[slot]
    speed_mps = _speed_mps(robots, slot, (newest - 1) % kept, newest)
    if robots.reports[slot] < 3:
        return speed_mps, speed_mps
    return speed_mps, _speed_mps(robots, slot, (newest - 2) % kept, (newest - 1) % kept)


@inner
def _speed_mps(robots: KnownRobots, slot: int, before: int, after: int) -> float:
    a, b = robots.tracks[slot, before, 0], robots.tracks[slot, after, 0]
    return float(hypot(b[0] - a[0], b[1] - a[1]) / max(robots.t_s[slot, after] - robots.t_s[slot, before], 0.5))


@inner
def _needed_s(robots: KnownRobots, state: Any, references: Floats, slot: int, lasted_s: float) -> float:
    """How long a robot should have needed since the report before its last, if nothing had been in its way."""
    kept = robots.t_s.shape[1]
    newest = robots.newest[slot]
    before, now = robots.tracks[slot, (newest - 1) % kept, 0], robots.tracks[slot, newest, 0]
    went_m, came_m = way_between_m(before, now), hypot(now[0] - before[0], now[1] - before[1])
    if came_m < STANDS_M <= went_m:
        return lasted_s
    needed_s, has_plan = lasted_s, state.references > 0
    for back in range(1, robots.reports[slot]):
        track = robots.tracks[slot, (newest - back) % kept]
        if _is_moving(track):
            has_plan = True
            if went_m >= STANDS_M:
                by_plan_s = planned_s(track, before, now)
                needed_s = min(needed_s, by_plan_s)
    if went_m < STANDS_M:
        return 0.0 if has_plan else lasted_s
    for at in range(state.references):
        by_plan_s = planned_s(references[slot, at], before, now)
        needed_s = min(needed_s, by_plan_s)
    if needed_s == lasted_s:
        needed_s = _beside_s(robots, state, references, slot, lasted_s)
    if needed_s > 0.0:
        needed_s = min(lasted_s, max(needed_s, went_m / state.usual_mps))
    return needed_s


@inner
def _beside_s(robots: KnownRobots, state: Any, references: Floats, slot: int, lasted_s: float) -> float:
    """The same for a robot that has left its way, by the speeds of its forecasts beside it."""
    kept = robots.t_s.shape[1]
    newest = robots.newest[slot]
    before, now = robots.tracks[slot, (newest - 1) % kept, 0], robots.tracks[slot, newest, 0]
    needed_s = lasted_s
    for back in range(1, robots.reports[slot]):
        needed_s = min(needed_s, beside_s(robots.tracks[slot, (newest - back) % kept], before, now))
    for at in range(state.references):
        needed_s = min(needed_s, beside_s(references[slot, at], before, now))
    return needed_s


@inner
def _keep_way(robots: KnownRobots, slot: int) -> None:
    """Keep the newest forecast as the robot's way."""
    copy_rows(robots.tracks[slot, robots.newest[slot]], robots.ways[slot])
    robots.has_way[slot] = True


@inner
def _keep_references(robots: KnownRobots, state: Any, references: Floats, slot: int) -> None:
    """Keep the newest forecasts from before the last report."""
    state.references = 0
    for back in range(1, robots.reports[slot]):
        track = robots.tracks[slot, (robots.newest[slot] - back) % robots.t_s.shape[1]]
        if state.references < REFERENCES and _is_moving(track):
            copy_rows(track, references[slot, state.references])
            state.references += 1


@inner
def _drives_on(state: Any) -> None:
    """The robot is as fast as planned, or not on its way any more."""
    state.loses, state.blocker, state.references, state.pending_s = False, NOBODY, 0, 0.0
    state.seen_s, state.pending_from_s = -inf, -inf


@inner
def _is_going(robots: KnownRobots, state: Any, slot: int, goes: int) -> bool:
    """Whether a robot is on its way. One that waits, and names no destination, is if its last plan led on."""
    if goes != WAITS:
        return bool(goes == GOES and state.went in (GOES, WAITS))
    here = robots.tracks[slot, robots.newest[slot], 0]
    end = robots.ways[slot, robots.ways.shape[1] - 1]
    return bool(state.loses and state.blocker != NOBODY and hypot(end[0] - here[0], end[1] - here[1]) > LEAVES_M)


@inner
def _bends(robots: KnownRobots, slot: int) -> bool:
    newest = robots.newest[slot]
    track, before = robots.tracks[slot, newest], robots.tracks[slot, (newest - 1) % robots.t_s.shape[1], 0]
    turned_rad, turns_rad = _turn_between(before[2], track[0, 2]), _turn_between(track[0, 2], track[LOOK_S, 2])
    return abs(turned_rad) > BENDS_RAD or abs(turns_rad) > BENDS_AHEAD_RAD


@inner
def _lost_s(robots: KnownRobots, state: Any, references: Floats, slot: int, goes: int, plans: int) -> float:
    """What a robot has lost since the report before its newest one; 0 if it is not worth mentioning, or not known."""
    lasted_s = robots.t_s[slot, robots.newest[slot]] - state.heard_s
    if not state.known or robots.reports[slot] < 2 or lasted_s > APART_S:
        return 0.0
    speed_mps = _speeds_mps(robots, slot)[0]
    if speed_mps > MOVES_MPS:
        state.usual_mps = max(state.usual_mps * FADES, min(speed_mps, FASTEST_MPS))
    if state.usual_mps < MOVES_MPS or not _is_going(robots, state, slot, goes):
        return 0.0
    may_bend = plans < ORDER or (plans == ORDER and _bends(robots, slot))
    if may_bend and speed_mps > CREEPS_MPS and not (state.loses and state.blocker != NOBODY):
        return 0.0
    if speed_mps > (1.0 - LOSES_SHARE) * state.usual_mps:
        return 0.0
    lost_s = lasted_s - _needed_s(robots, state, references, slot, lasted_s)
    return lost_s if lost_s >= LOSES_SHARE * lasted_s else 0.0


@inner
def _look_for_blocker(robots: KnownRobots, state: Any, slot: int, plans: int) -> None:
    """Update the blocker of a robot that loses time."""
    speed_mps, before_mps = _speeds_mps(robots, slot)
    if state.blocker != NOBODY and speed_mps > before_mps + RISES_MPS:
        return
    newest = robots.newest[slot]
    before = (newest - 1) % robots.t_s.shape[1]
    begin, now = robots.tracks[slot, before, 0], robots.tracks[slot, newest, 0]
    came_m = hypot(now[0] - begin[0], now[1] - begin[1])
    way = way_ahead(robots.ways[slot], begin[0], begin[1], begin[2], FARTHEST_M + came_m)
    begin_s, now_s = robots.t_s[slot, before], robots.t_s[slot, newest]
    losing = LosingRobot(slot, begin_s, now_s, max(speed_mps, before_mps), way, came_m, state.blocker)
    blocker, is_on_way = find_blocker(robots, losing)
    if blocker != NOBODY and (is_on_way or plans >= ORDER):
        state.blocker, state.is_on_way, state.seen_s = blocker, is_on_way, now_s
    elif now_s - state.seen_s > KEEPS_S:
        state.blocker = NOBODY


@inner
def _with_pending(state: Any, from_s: float, now_s: float, lost_s: float, over_s: float) -> tuple[float, float, float]:
    """From when on a robot has lost how much, by its plan and against the usual time, with what it lost shortly before
    its blocker was seen."""
    if state.blocker == NOBODY:
        if now_s - state.pending_from_s > BEFORE_S:
            state.pending_s, state.pending_over_s, state.pending_from_s = 0.0, 0.0, from_s
        state.pending_s += lost_s
        state.pending_over_s += over_s
    elif state.pending_s > 0.0:
        pending_s, state.pending_s = state.pending_s, 0.0
        if from_s - state.pending_from_s <= BEFORE_S:
            return state.pending_from_s, lost_s + pending_s, over_s + state.pending_over_s
    return from_s, lost_s, over_s


@inner
def _with_mutual_wait(
    states: Losing, slot: int, other: int, from_s: float, lost_s: float, over_s: float
) -> tuple[float, float, float]:
    """From when on a robot has lost how much, by its plan and against the usual time, where it waits for `other`, which
    waits for it: all the time for which both have stood, if nobody else was in its way."""
    state = states[slot]
    if other == NOBODY or state.blocker not in (NOBODY, other):
        return from_s, lost_s, over_s
    if state.blocker == NOBODY:
        state.pending_s, state.is_on_way = 0.0, False
        from_s = max(state.stood_s, states[other].stood_s, state.booked_s)
        lost_s = over_s = 0.0
    if lost_s <= 0.0:
        lost_s = over_s = state.heard_s - from_s
    state.blocker, state.seen_s = other, state.heard_s
    return from_s, lost_s, over_s


@inner
def _over_usual_s(
    usual: UsualTimes, robots: KnownRobots, state: Any, slot: int, kind: int, goes: int, lost_s: float
) -> float:
    """What a robot needed longer than usual since the report before its newest one; what it lost by its plan where the
    usual time is not known. Learns from a robot that loses nothing."""
    newest = robots.newest[slot]
    now_s, before = robots.t_s[slot, newest], robots.tracks[slot, (newest - 1) % robots.t_s.shape[1], 0]
    now, floor, lasted_s = robots.tracks[slot, newest, 0], robots.floor[slot, newest], now_s - state.heard_s
    if lost_s > 0.0:
        state.lost_at_s = now_s
        needed_s = usual_s(usual, kind, floor, before, now)
        return lasted_s - needed_s if needed_s >= 0.0 else lost_s
    is_heard = state.known and robots.reports[slot] > 1 and lasted_s <= APART_S
    if (
        is_heard
        and goes == GOES
        and _speeds_mps(robots, slot)[0] > MOVES_MPS
        and now_s > state.lost_at_s + AGAIN_USUAL_S
    ):
        learn_pass(usual, kind, floor, before, now, lasted_s)
    return 0.0


@kernel(LOST_TYPE(LOSING_TYPE, CUBES, KNOWN, INTS, READ_FLOATS, INTS, INTS, USUAL, INTS))
def lost_times(
    states: Losing,
    references: Floats,
    robots: KnownRobots,
    slots: Ints,
    event_s: Floats,
    goes: Ints,
    plans: Ints,
    usual: UsualTimes,
    kinds: Ints,
) -> LostTimes:
    """The times that robots `slots` (n,) have lost until their reports of `event_s` (n,), which `robots` has.

    `goes` (n,) is what they say of themselves, and `plans` (n,) what their forecasts tell. `references` (slots,
    REFERENCES, k, 3) are forecasts from before. `usual` learns from these reports, by the models `kinds` (n,).
    """
    found, n = np.empty(len(slots), LOST), 0
    for row in range(len(slots)):
        slot, now_s = slots[row], event_s[row]
        state, newest = states[slot], robots.newest[slot]
        if robots.reports[slot] == 0 or robots.t_s[slot, newest] != now_s or (state.known and state.heard_s >= now_s):
            continue
        if plans[row] > NO_WAY and _is_moving(robots.tracks[slot, newest]):
            _keep_way(robots, slot)
            state.is_planned = plans[row] >= ORDER
        note_standing(robots, state, slot, goes[row])
        lost_s = _lost_s(robots, state, references, slot, goes[row], plans[row])
        over_s = _over_usual_s(usual, robots, state, slot, kinds[row], goes[row], lost_s)
        from_s, state.known, state.heard_s, state.went = state.heard_s, True, now_s, goes[row]
        other = mutual_wait(robots, states, slot)
        if lost_s <= 0.0 and other == NOBODY:
            _drives_on(state)
        elif robots.has_way[slot]:
            if not state.loses:
                _keep_references(robots, state, references, slot)
                state.loses = True
            if lost_s > 0.0:
                _look_for_blocker(robots, state, slot, plans[row])
            from_s, lost_s, over_s = _with_mutual_wait(states, slot, other, from_s, lost_s, over_s)
            found[n].row, found[n].blocker, found[n].until_s = row, state.blocker, now_s
            from_s, lost_s, over_s = _with_pending(state, from_s, now_s, lost_s, over_s)
            found[n].from_s, found[n].lost_s, found[n].over_s = from_s, lost_s, over_s
            found[n].is_on_way, found[n].is_mutual = state.is_on_way, other != NOBODY and state.blocker == other
            if state.blocker != NOBODY:
                state.booked_s = now_s
            n += 1
    return found[:n].copy()
