"""Driving robots on along their forecasts, each with a protective stop: which pairs give way or come too close.

A robot drives along its own track, and waits while another body is in its field. The field is its own outline, longer
in front by its braking distance and a margin. So a robot that waits for a third one does not reach its forecast place.

The file is long because it holds the whole compiled simulation: `drive` calls its helpers once for each robot and time
step, and `_overlap` takes plain numbers, as a record would have to be filled first for each of two turned rectangles.
"""

from math import cos, hypot, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.foresight.motion_assumptions import BRAKES_MPS2, LOST_S, MOVES_MPS
from deconflict.sweep.geometry.heights import heights_overlap
from ingest.batch import Bools, Floats, Ints
from ingest.frames.angles import turn_between
from ingest.kernels import BOOLS, CUBE, FLOAT, FLOATS, INT, INT_MATRIX, INTS, MATRIX, inner, kernel

STEP_S = 0.5
MARGIN_M, BESIDE_M = 0.45, 0.05
"""How much longer in front, and wider at each side, than the robot its field is when it stands."""
RELEASE_M = 0.1
"""The field of a waiting robot is longer by this, so that it does not start and brake in turns."""
HELD_S = 1.0
"""Time for which a field must be free before the robot drives on."""
CREEPS_MPS, STRAIGHT_RAD = 0.05, 0.01
"""A slower robot stands; a robot that turns by less in a second drives straight on."""
KEEPS_M = 0.3
"""A robot waits for the nearest one in its field. It keeps waiting for the same one as long as no other is nearer by
more than this."""

EDGE = np.dtype(
    [
        ("robot", np.int64),  # row of the robot from which the pair is seen
        ("other", np.int64),  # row of the other robot
        ("pair", np.int64),  # the edge of the same two seen from the lower row; it counts for both
        ("gave_way", np.float64),  # number of samples in which the two get in each other's way
    ],
    align=True,
)
"""Two robots that may get in each other's way, seen from one of them."""
Edges = NDArray[Any]

LEG = np.dtype(
    [
        ("x", np.float64),  # place at the start of the second, metres
        ("y", np.float64),
        ("yaw", np.float64),  # heading there, radians
        ("cos", np.float64),  # cosine of the heading
        ("sin", np.float64),  # sine of the heading
        ("by_x", np.float64),  # displacement along x within the second
        ("by_y", np.float64),  # displacement along y
        ("turn", np.float64),  # change of the heading within the second
        ("mps", np.float64),  # speed
        ("goes_x", np.float64),  # x of the unit vector of travel; of the heading while it stands
        ("goes_y", np.float64),  # y of it
    ],
    align=True,
)
"""The motion of a track within one second."""

BODY = np.dtype(
    [
        ("x", np.float64),  # centre, metres
        ("y", np.float64),
        ("reach", np.float64),  # largest distance of its field or body from its centre, at any time
        ("cos", np.float64),  # cosine of the heading
        ("sin", np.float64),  # sine of the heading
        ("goes_x", np.float64),  # x of the unit vector of travel
        ("goes_y", np.float64),  # y of it
        ("path_mps", np.float64),  # speed of its track here
        ("progress_s", np.float64),  # its place on the track, in seconds of the track
        ("pace", np.float64),  # its speed now, as a share of that of the track
        ("top_pace", np.float64),  # the largest such share
        ("starts_s", np.float64),  # when it starts at the earliest
        ("held_s", np.float64),  # until when it waits after its field became free
        ("edge", np.int64),  # to the robot that it waits for, -1 if there is none
        ("since_s", np.float64),  # when it began to wait, -1 if it stood already
        ("lost_s", np.float64),  # time that it has lost since then
    ],
    align=True,
)
"""A robot that is driven on."""

_EDGES = numba.from_dtype(EDGE)[::1]
_PAIRS = INT_MATRIX


_turn_between = inner(turn_between)
_heights_overlap = inner(heights_overlap)


@inner
def _overlap(
    ax: float,
    ay: float,
    ac: float,
    as_: float,
    length_a: float,
    width_a: float,
    bx: float,
    by: float,
    bc: float,
    bs: float,
    length_b: float,
    width_b: float,
) -> bool:
    """Whether two rectangles with these centres, headings (cosine, sine) and half sides overlap (separating axes)."""
    dx, dy = bx - ax, by - ay
    c, s = abs(ac * bc + as_ * bs), abs(ac * bs - as_ * bc)
    return not (
        abs(dx * ac + dy * as_) > length_a + length_b * c + width_b * s
        or abs(dy * ac - dx * as_) > width_a + length_b * s + width_b * c
        or abs(dx * bc + dy * bs) > length_b + length_a * c + width_a * s
        or abs(dy * bc - dx * bs) > width_b + length_a * s + width_a * c
    )


@inner
def _legs_of(track: Floats) -> Any:
    """(n, k) of `LEG`: the motion from each second of a track to the next; after the last, robots stand."""
    legs = np.empty(track.shape[:2], LEG)
    last = track.shape[1] - 1
    for robot in range(track.shape[0]):
        for at in range(last + 1):
            leg, yaw = legs[robot, at], track[robot, at, 2]
            leg.x, leg.y, leg.yaw = track[robot, at, 0], track[robot, at, 1], yaw
            leg.cos, leg.sin = cos(yaw), sin(yaw)
            after = min(at + 1, last)
            leg.by_x, leg.by_y = track[robot, after, 0] - leg.x, track[robot, after, 1] - leg.y
            leg.turn = _turn_between(yaw, track[robot, after, 2])
            leg.mps = hypot(leg.by_x, leg.by_y)
            moves = leg.mps > CREEPS_MPS
            leg.goes_x = leg.by_x / leg.mps if moves else leg.cos
            leg.goes_y = leg.by_y / leg.mps if moves else leg.sin
    return legs


@inner
def _place(body: Any, legs: Any, robot: int) -> None:
    """Set the place and heading of a robot from its place on the track."""
    at_s = min(max(body.progress_s, 0.0), legs.shape[1] - 1.0)
    at = int(at_s)
    leg, part = legs[robot, at], at_s - at
    body.x, body.y = leg.x + part * leg.by_x, leg.y + part * leg.by_y
    body.path_mps, body.goes_x, body.goes_y = leg.mps, leg.goes_x, leg.goes_y
    if abs(leg.turn) < STRAIGHT_RAD:
        body.cos, body.sin = leg.cos, leg.sin
    else:
        body.cos, body.sin = cos(leg.yaw + part * leg.turn), sin(leg.yaw + part * leg.turn)


@inner
def _in_field(body: Any, other: Any, half_m: Floats, robot: int, beside: int) -> bool:
    """Whether the body of `other`, longer by its own braking distance, is in the field of a robot."""
    mps, other_mps = body.pace * body.path_mps, other.pace * other.path_mps
    longer = mps * mps / (2 * BRAKES_MPS2) + MARGIN_M + (RELEASE_M if body.edge >= 0 else 0.0)
    coming = other_mps * other_mps / (2 * BRAKES_MPS2)
    moves = other_mps > CREEPS_MPS
    return _overlap(
        body.x + body.goes_x * longer / 2,
        body.y + body.goes_y * longer / 2,
        body.goes_x,
        body.goes_y,
        half_m[0, robot] + longer / 2,
        half_m[1, robot] + BESIDE_M,
        other.x + other.goes_x * coming / 2,
        other.y + other.goes_y * coming / 2,
        other.goes_x if moves else other.cos,
        other.goes_y if moves else other.sin,
        half_m[0, beside] + coming / 2,
        half_m[1, beside],
    )


@inner
def _in_the_way(bodies: Any, edges: Edges, first: Ints, half_m: Floats, robot: int) -> int:
    """The edge to the robot that `robot` has to wait for now, -1 if there is none."""
    body, found, nearest_m = bodies[robot], -1, np.inf
    if body.path_mps <= CREEPS_MPS:
        return found
    for at in range(first[robot], first[robot + 1]):
        beside = edges[at].other
        other = bodies[beside]
        dx, dy, reach = other.x - body.x, other.y - body.y, body.reach + other.reach
        if dx * dx + dy * dy > reach * reach:
            continue
        apart_m = hypot(dx, dy) - (KEEPS_M if body.edge == at else 0.0)
        if apart_m < nearest_m and _in_field(body, other, half_m, robot, beside):
            found, nearest_m = at, apart_m
    return found


@inner
def _advance(body: Any, edge: int, now_s: float) -> None:
    """Advance a robot by one time step. `edge` leads to the robot in its field, -1 if the field is free."""
    if edge >= 0:
        if body.edge != edge:
            body.edge, body.lost_s = edge, 0.0
            body.since_s = now_s if body.pace * body.path_mps > MOVES_MPS else -1.0
        body.held_s = now_s + HELD_S
    elif now_s >= body.held_s:
        body.edge = -1
    change = BRAKES_MPS2 * STEP_S / max(body.path_mps, BRAKES_MPS2 * STEP_S)
    if body.edge >= 0 or now_s < body.starts_s:
        body.pace = max(body.pace - change, 0.0)
    else:
        body.pace = min(body.pace + change, body.top_pace)
    if body.edge >= 0:
        body.lost_s += max(1.0 - body.pace, 0.0) * STEP_S
    body.progress_s += body.pace * STEP_S


@inner
def _mark(marked: Bools, edges: Edges, at: int) -> None:
    """Count that the two of an edge are in each other's way, once in a sample."""
    if not marked[at]:
        marked[at] = True
        edges[at].gave_way += 1.0


@inner
def _mark_close(marked: Bools, bodies: Any, edges: Edges, half_m: Floats, grown_m: float) -> None:
    """Count the pairs that are within the clearance, once in a sample."""
    for at in range(len(edges)):
        robot, beside = edges[at].robot, edges[at].other
        if marked[at] or edges[at].pair != at:
            continue
        a, b = bodies[robot], bodies[beside]
        dx, dy, reach = b.x - a.x, b.y - a.y, a.reach + b.reach
        if dx * dx + dy * dy < reach * reach and _overlap(
            a.x,
            a.y,
            a.cos,
            a.sin,
            half_m[0, robot] + grown_m,
            half_m[1, robot] + grown_m,
            b.x,
            b.y,
            b.cos,
            b.sin,
            half_m[0, beside] + grown_m,
            half_m[1, beside] + grown_m,
        ):
            _mark(marked, edges, at)


@kernel((FLOATS, CUBE, MATRIX, *[FLOAT] * 2))
def reaches(
    since_s: Floats, track: Floats, half_m: Floats, horizon_s: float, clearance_m: float
) -> tuple[Floats, Floats]:
    """(n, 4) boxes around the paths of n robots in the horizon, as lowest and highest x, lowest and highest y; and (n,)
    how far a robot's field, or its body and half the clearance, may reach from its centre. Boxes are grown by that."""
    n, last = len(since_s), track.shape[1] - 1
    box, reach = np.empty((n, 4)), np.empty(n)
    for robot in range(n):
        begin = min(max(int(since_s[robot]), 0), last)
        end = min(int(since_s[robot] + horizon_s) + 2, last)
        low_x = high_x = track[robot, begin, 0]
        low_y = high_y = track[robot, begin, 1]
        fastest = 0.0
        for at in range(begin + 1, end + 1):
            x, y = track[robot, at, 0], track[robot, at, 1]
            fastest = max(fastest, hypot(x - track[robot, at - 1, 0], y - track[robot, at - 1, 1]))
            low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
        by = hypot(half_m[0, robot], half_m[1, robot]) + MARGIN_M + RELEASE_M + BESIDE_M + clearance_m / 2
        reach[robot] = by = by + fastest * fastest / (2 * BRAKES_MPS2)
        box[robot, 0], box[robot, 1] = low_x - by, high_x + by
        box[robot, 2], box[robot, 3] = low_y - by, high_y + by
    return box, reach


@kernel(_PAIRS(MATRIX, INTS, MATRIX, FLOATS))
def pairs_beside(box: Floats, order: Ints, levels_m: Floats, floor: Floats) -> Ints:
    """(p, 2) the pairs that may get in each other's way, the lower row first: those whose boxes (n, 4) and heights
    `levels_m` (2, n), bottom and top, overlap on one `floor` (n,). `order` (n,) is that of the lowest x."""
    n, found, bottom_m, top_m = len(order), 0, levels_m[0], levels_m[1]
    pairs = np.empty((64, 2), np.int64)
    for place in range(n):
        robot = order[place]
        for later in range(place + 1, n):
            other = order[later]
            if box[other, 0] > box[robot, 1]:
                break
            beside = box[other, 2] <= box[robot, 3] and box[robot, 2] <= box[other, 3]
            level = _heights_overlap(bottom_m[robot], top_m[robot], bottom_m[other], top_m[other])
            if not (beside and level and floor[robot] == floor[other] and floor[robot] >= 0.0):
                continue
            if found == len(pairs):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
            pairs[found, 0], pairs[found, 1], found = min(robot, other), max(robot, other), found + 1
    return pairs[:found].copy()


@kernel((_PAIRS, INT))
def edges_of(pairs: Ints, robots: int) -> tuple[Edges, Ints]:
    """The edges of `pairs` (p, 2) of `robots` robots, robot by robot; and (robots + 1,) where those of each robot
    begin."""
    first = np.zeros(robots + 1, np.int64)
    for low, high in pairs:
        first[low + 1], first[high + 1] = first[low + 1] + 1, first[high + 1] + 1
    for robot in range(robots):
        first[robot + 1] += first[robot]
    edges, free = np.zeros(2 * len(pairs), EDGE), first.copy()
    for low, high in pairs:
        edges[free[low]].robot, edges[free[low]].other = low, high
        edges[free[high]].robot, edges[free[high]].other = high, low
        edges[free[low]].pair = edges[free[high]].pair = free[low]
        free[low], free[high] = free[low] + 1, free[high] + 1
    return edges, first


@kernel(INTS(_EDGES, INTS, *[FLOATS] * 2, CUBE, MATRIX, BOOLS, *[MATRIX] * 2, *[FLOAT] * 2))
def drive(
    edges: Edges,
    first: Ints,
    reach_m: Floats,
    since_s: Floats,
    track: Floats,
    half_m: Floats,
    stands: Bools,
    starts_s: Floats,
    top_pace: Floats,
    horizon_s: float,
    clearance_m: float,
) -> Ints:
    """Drive n robots through the horizon once for each sample, and count in `edges` which pairs get in each other's
    way.

    `edges` and `first` (n + 1,) are those of `edges_of`. Each robot is `since_s` (n,) seconds along its `track` (n, k,
    4), which has a sample every second. It `stands` (n,) or goes at the speed of its track. In sample s it starts at
    `starts_s` (s, n) at the earliest, and goes at most at `top_pace` (s, n) times the speed of its track. No part of
    its field is further than `reach_m` (n,) from its centre.

    Returns (n,) for each robot that stands the edge to the robot that it has to wait for now, -1 if there is none.
    """
    n, steps, legs = len(since_s), int(horizon_s / STEP_S), _legs_of(track)
    waits_for, bodies = np.full(n, -1), np.empty(n, BODY)
    marked = np.empty(len(edges), np.bool_)
    for sample in range(len(starts_s)):
        marked[:] = False
        for robot in range(n):
            body = bodies[robot]
            body.progress_s, body.pace = since_s[robot], 0.0 if stands[robot] else 1.0
            body.starts_s, body.top_pace = starts_s[sample, robot], top_pace[sample, robot]
            body.reach = reach_m[robot]
            body.held_s, body.edge, body.since_s, body.lost_s = -1.0, -1, -1.0, 0.0
        for step in range(steps):
            now_s = step * STEP_S
            for robot in range(n):
                _place(bodies[robot], legs, robot)
            for robot in range(n):
                body = bodies[robot]
                edge = _in_the_way(bodies, edges, first, half_m, robot)
                if step == 0 and stands[robot]:
                    waits_for[robot] = edge
                _advance(body, edge, now_s)
                if body.edge >= 0 and body.since_s >= 0.0 and body.lost_s >= LOST_S:
                    _mark(marked, edges, edges[body.edge].pair)
            _mark_close(marked, bodies, edges, half_m, clearance_m / 2)
    return waits_for
