"""Robots driven on along their forecasts, each with a protective stop: who gives way to whom, and who comes too close.

Compiled. A robot goes on along its own track, and waits where another body is in its field: its own outline, longer in
front by its braking distance and a margin. So one that waits for a third robot does not come to where it said.
"""

from math import cos, hypot, pi, sin
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ingest.batch import Bools, Floats, Ints
from ingest.kernels import inner, kernel

STEP_S = 0.5
BRAKES_MPS2 = 1.0
MARGIN_M, BESIDE_M = 0.45, 0.05
"""How much longer in front, and wider at each side, the field of a robot is than itself, when it stands."""
RELEASE_M = 0.1
"""The field of one that waits is so much longer, so that it does not start and brake in turns."""
HELD_S = 1.0
"""A field must be free for so long before a robot goes on."""
LOST_S, MOVES_MPS = 1.0, 0.3
"""A robot gives way where it went at least so fast, and loses so much time."""
CREEPS_MPS, STRAIGHT_RAD = 0.05, 0.01
"""One that goes more slowly stands; one that turns by less in a second goes straight on."""
KEEPS_M = 0.3
"""Of two in its field a robot waits for the nearer; for the one that it waits for already, if that is not so much
further."""

EDGE = np.dtype(
    [
        ("robot", np.int64),
        ("other", np.int64),
        ("pair", np.int64),  # the edge of the same two, seen from the lower of them, which counts for both
        ("gave_way", np.float64),  # in how many samples they get in each other's way within the horizon
    ],
    align=True,
)
"""Two robots that may be in each other's way, seen from one of them."""
Edges = NDArray[Any]

LEG = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("yaw", np.float64),
        ("cos", np.float64),  # of the heading
        ("sin", np.float64),
        ("by_x", np.float64),  # how far it goes within the second
        ("by_y", np.float64),
        ("turn", np.float64),  # by how much it turns
        ("mps", np.float64),
        ("goes_x", np.float64),  # direction in which it goes
        ("goes_y", np.float64),
    ],
    align=True,
)
"""What a track does within one second."""

BODY = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("reach", np.float64),  # furthest that its field or body may ever be from its middle
        ("cos", np.float64),  # of the heading
        ("sin", np.float64),
        ("goes_x", np.float64),  # direction in which it goes
        ("goes_y", np.float64),
        ("path_mps", np.float64),  # as its track has it go here
        ("place_s", np.float64),  # how far along its track it is
        ("pace", np.float64),  # of its track's speed, at which it goes now
        ("top_pace", np.float64),
        ("starts_s", np.float64),  # when it starts at the earliest
        ("held_s", np.float64),  # until when it reacts to what was in its field
        ("edge", np.int64),  # of whom it waits for, -1 where for nobody
        ("since_s", np.float64),  # when it began to, -1 where it stood already
        ("lost_s", np.float64),  # time that it has lost so
    ],
    align=True,
)
"""A robot on its way."""

_EDGES, _BODIES = (numba.from_dtype(kind)[::1] for kind in (EDGE, BODY))
_INTS, _FLOATS, _MATRIX, _CUBE = numba.int64[::1], numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]


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
    """Whether two rectangles with these middles, headings (cosine, sine) and half sides overlap (separating axes)."""
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
    """(n, k) of `LEG`: what tracks do from each of their seconds to the next; at the last, robots stand."""
    legs = np.empty(track.shape[:2], LEG)
    last = track.shape[1] - 1
    for robot in range(track.shape[0]):
        for at in range(last + 1):
            leg, yaw = legs[robot, at], track[robot, at, 2]
            leg.x, leg.y, leg.yaw = track[robot, at, 0], track[robot, at, 1], yaw
            leg.cos, leg.sin = cos(yaw), sin(yaw)
            after = min(at + 1, last)
            leg.by_x, leg.by_y = track[robot, after, 0] - leg.x, track[robot, after, 1] - leg.y
            leg.turn = (track[robot, after, 2] - yaw + pi) % (2 * pi) - pi
            leg.mps = hypot(leg.by_x, leg.by_y)
            moves = leg.mps > CREEPS_MPS
            leg.goes_x = leg.by_x / leg.mps if moves else leg.cos
            leg.goes_y = leg.by_y / leg.mps if moves else leg.sin
    return legs


@inner
def _place(body: Any, legs: Any, robot: int) -> None:
    """Put a robot where its track has it."""
    at_s = min(max(body.place_s, 0.0), legs.shape[1] - 1.0)
    at = int(at_s)
    leg, part = legs[robot, at], at_s - at
    body.x, body.y = leg.x + part * leg.by_x, leg.y + part * leg.by_y
    body.path_mps, body.goes_x, body.goes_y = leg.mps, leg.goes_x, leg.goes_y
    if abs(leg.turn) < STRAIGHT_RAD:
        body.cos, body.sin = leg.cos, leg.sin
    else:
        body.cos, body.sin = cos(leg.yaw + part * leg.turn), sin(leg.yaw + part * leg.turn)


@inner
def _in_field(body: Any, other: Any, half: Floats, robot: int, beside: int) -> bool:
    """Whether the other's body, longer by its own braking distance, is in a robot's field."""
    mps, other_mps = body.pace * body.path_mps, other.pace * other.path_mps
    longer = mps * mps / (2 * BRAKES_MPS2) + MARGIN_M + (RELEASE_M if body.edge >= 0 else 0.0)
    coming = other_mps * other_mps / (2 * BRAKES_MPS2)
    moves = other_mps > CREEPS_MPS
    return _overlap(
        body.x + body.goes_x * longer / 2,
        body.y + body.goes_y * longer / 2,
        body.goes_x,
        body.goes_y,
        half[0, robot] + longer / 2,
        half[1, robot] + BESIDE_M,
        other.x + other.goes_x * coming / 2,
        other.y + other.goes_y * coming / 2,
        other.goes_x if moves else other.cos,
        other.goes_y if moves else other.sin,
        half[0, beside] + coming / 2,
        half[1, beside],
    )


@inner
def _in_the_way(bodies: Any, edges: Edges, first: Ints, half: Floats, robot: int) -> int:
    """The edge of whom a robot has to wait for now, -1 where of nobody."""
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
        if apart_m < nearest_m and _in_field(body, other, half, robot, beside):
            found, nearest_m = at, apart_m
    return found


@inner
def _go_on(body: Any, edge: int, now_s: float) -> None:
    """One step of a robot whose field holds whom `edge` is of, -1 where nobody."""
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
    body.place_s += body.pace * STEP_S


@inner
def _mark(marked: Bools, edges: Edges, at: int) -> None:
    """Count that two are in each other's way, once in a sample."""
    if not marked[at]:
        marked[at] = True
        edges[at].gave_way += 1.0


@inner
def _mark_close(marked: Bools, bodies: Any, edges: Edges, half: Floats, grown_m: float) -> None:
    """Count the pairs that are within the clearance, once in a sample."""
    for at in range(len(edges)):
        robot, beside = edges[at].robot, edges[at].other
        if marked[at] or edges[at].pair != at:
            continue
        one, other = bodies[robot], bodies[beside]
        dx, dy, reach = other.x - one.x, other.y - one.y, one.reach + other.reach
        if dx * dx + dy * dy < reach * reach and _overlap(
            one.x,
            one.y,
            one.cos,
            one.sin,
            half[0, robot] + grown_m,
            half[1, robot] + grown_m,
            other.x,
            other.y,
            other.cos,
            other.sin,
            half[0, beside] + grown_m,
            half[1, beside] + grown_m,
        ):
            _mark(marked, edges, at)


@kernel(numba.types.Tuple((_MATRIX, _FLOATS))(_FLOATS, _CUBE, _MATRIX, *[numba.float64] * 2))  # type: ignore[no-untyped-call]
def reaches(
    since_s: Floats, track: Floats, half: Floats, horizon_s: float, clearance_m: float
) -> tuple[Floats, Floats]:
    """Boxes around the ways of n robots in the horizon (n, 4): lowest and highest x, and y; grown by how far a robot's
    field, or its body and half the clearance, may reach from its middle (n,)."""
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
        by = hypot(half[0, robot], half[1, robot]) + MARGIN_M + RELEASE_M + BESIDE_M + clearance_m / 2
        reach[robot] = by = by + fastest * fastest / (2 * BRAKES_MPS2)
        box[robot, 0], box[robot, 1] = low_x - by, high_x + by
        box[robot, 2], box[robot, 3] = low_y - by, high_y + by
    return box, reach


@kernel(numba.types.Tuple((_EDGES, _INTS))(_MATRIX, _INTS, _MATRIX, _FLOATS))  # type: ignore[no-untyped-call]
def edges_of(box: Floats, order: Ints, levels_m: Floats, floor: Floats) -> tuple[Edges, Ints]:
    """Who may come into whose way: those whose boxes (n, 4) overlap, on one `floor` (n,), and in height (`levels_m`
    (2, n), bottom and top). `order` (n,) is by lowest x. Edges by robot, and where those of each begin (n + 1,)."""
    n, found = len(order), 0
    pairs = np.empty((64, 2), np.int64)
    first = np.zeros(n + 1, np.int64)
    for place in range(n):
        robot = order[place]
        for later in range(place + 1, n):
            other = order[later]
            if box[other, 0] > box[robot, 1]:
                break
            beside = box[other, 2] <= box[robot, 3] and box[robot, 2] <= box[other, 3]
            level = levels_m[0, robot] < levels_m[1, other] and levels_m[0, other] < levels_m[1, robot]
            if not (beside and level and floor[robot] == floor[other] and floor[robot] >= 0.0):
                continue
            if found == len(pairs):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
            pairs[found, 0], pairs[found, 1], found = min(robot, other), max(robot, other), found + 1
            first[robot + 1], first[other + 1] = first[robot + 1] + 1, first[other + 1] + 1
    for robot in range(n):
        first[robot + 1] += first[robot]
    edges, free = np.zeros(2 * found, EDGE), first.copy()
    for at in range(found):
        low, high = pairs[at]
        edges[free[low]].robot, edges[free[low]].other = low, high
        edges[free[high]].robot, edges[free[high]].other = high, low
        edges[free[low]].pair = edges[free[high]].pair = free[low]
        free[low], free[high] = free[low] + 1, free[high] + 1
    return edges, first


@kernel(_INTS(_EDGES, _INTS, *[_FLOATS] * 2, _CUBE, _MATRIX, numba.boolean[::1], *[_MATRIX] * 2, *[numba.float64] * 2))
def drive(
    edges: Edges,
    first: Ints,
    reach_m: Floats,
    since_s: Floats,
    track: Floats,
    half: Floats,
    stands: Bools,
    starts_s: Floats,
    top_pace: Floats,
    horizon_s: float,
    clearance_m: float,
) -> Ints:
    """Drive n robots through the horizon once a sample, and count in `edges` who gets in whose way.

    Edges are as `edges_of` gives them; those of a robot begin at `first` (n + 1,). Each robot is `since_s` (n,) along
    its `track` (n, k, 4), sampled every second, and `stands` (n,) or goes as its track says. In sample s it starts at
    `starts_s` (s, n) at the earliest and goes at most at `top_pace` (s, n) of its track's speed. Nothing of it is
    further than `reach_m` (n,) from its middle.

    (n,) for whom each robot that stands has to wait now: the edge, -1 where for nobody.
    """
    n, steps, legs = len(since_s), int(horizon_s / STEP_S), _legs_of(track)
    waits_for, bodies = np.full(n, -1), np.empty(n, BODY)
    marked = np.empty(len(edges), np.bool_)
    for sample in range(len(starts_s)):
        marked[:] = False
        for robot in range(n):
            body = bodies[robot]
            body.place_s, body.pace = since_s[robot], 0.0 if stands[robot] else 1.0
            body.starts_s, body.top_pace = starts_s[sample, robot], top_pace[sample, robot]
            body.reach = reach_m[robot]
            body.held_s, body.edge, body.since_s, body.lost_s = -1.0, -1, -1.0, 0.0
        for step in range(steps):
            now_s = step * STEP_S
            for robot in range(n):
                _place(bodies[robot], legs, robot)
            for robot in range(n):
                body = bodies[robot]
                edge = _in_the_way(bodies, edges, first, half, robot)
                if step == 0 and stands[robot]:
                    waits_for[robot] = edge
                _go_on(body, edge, now_s)
                if body.edge >= 0 and body.since_s >= 0.0 and body.lost_s >= LOST_S:
                    _mark(marked, edges, edges[body.edge].pair)
            _mark_close(marked, bodies, edges, half, clearance_m / 2)
    return waits_for
