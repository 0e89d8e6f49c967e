"""The first contact and the smallest separation of pairs of which at least one robot is a shape.

The method is that of `deconflict/sweep/narrowphase.py`, with the distances of true shapes. The rectangles around them
have excluded what keeps apart, so this begins where those first meet.
"""

from math import cos, inf, sin, sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.broadphase import BOX, PAIR, Pairs
from deconflict.sweep.geometry.knots import KNOT, ROBOT, Knots, Robots
from deconflict.sweep.narrowphase import (
    CONTACT,
    MOTION,
    PLACE,
    TINY_MPS,
    Contacts,
    Motions,
    Span,
    are_on_one_floor,
    both_there,
    motions_in_slab,
    nearest_centres,
)
from deconflict.sweep.shapes.shape_gaps import Body, Bridge, Table, body_of, gap, table_of
from deconflict.sweep.shapes.shape_table import CORNER, PIECE
from ingest.batch import Floats, Ints
from ingest.kernels import FLOAT, FLOATS, INT, INTS, inner, kernel

CLEAR, MET, OPEN = 0, 1, 2
"""Results of advancement: no contact, contact, and undecided."""
TINY_S = 1e-12
EDGE = 0.1
"""A span is cut at least this share of its length from its ends."""
MOST_SPANS = 200
"""Spans of one motion that are open at a time."""
Poses = Floats
"""(n, 5) of robot B in the frame of robot A: x, y and heading; and the shortest vector from A to B."""

_BOX, _KNOT, _ROBOT, _PAIR, _PIECE, _CORNER = map(numba.from_dtype, (BOX, KNOT, ROBOT, PAIR, PIECE, CORNER))
_TWO = numba.types.UniTuple(FLOAT, 2)  # type: ignore[no-untyped-call]
_FLOOR = (_BOX[:, ::1], _ROBOT[::1], _KNOT[::1])
_TABLE = (INTS, _PIECE[::1], _CORNER[::1])
_CONTACT = numba.from_dtype(CONTACT)


@inner
def _first_contact(
    m: Any, since: float, a: Body, b: Body, table: Table, target_m: float, tolerance_m: float, rounds: int
) -> tuple[float, int, Bridge]:
    """As `narrowphase.first_contact`, from `since` on; and the shortest vector between the two at a contact."""
    t, bridge = max(m.begin, since), (0.0, 0.0)
    if t > m.end:
        return t, CLEAR, bridge
    for _ in range(rounds):
        (nearest, lasts, _, _), bridge = gap(m, t, a, b, table, target_m + tolerance_m / 4, 0.0)
        if nearest <= target_m + tolerance_m / 2:
            return t, MET, bridge
        t += lasts
        if t > m.end:
            return t, CLEAR, bridge
    return t, OPEN, bridge


@inner
def _look(m: Any, t: float, a: Body, b: Body, table: Table, span_s: float) -> tuple[float, float, float]:
    """The distance at `t`, and by how much it closes a second at most: for `span_s` after, and before."""
    (nearest, _, after, before), _ = gap(m, t, a, b, table, 0.0, span_s)
    span_s = max(span_s, TINY_S)
    return nearest, (nearest - after) / span_s, (nearest - before) / span_s


@inner
def _set_span(span: Floats, begin: float, first: float, after: float, end: float, last: float, before: float) -> None:
    span[0], span[1], span[2], span[3], span[4], span[5] = begin, first, after, end, last, before


@inner
def _smallest_of_one(
    m: Any, a: Body, b: Body, table: Table, best: float, when: float, accuracy_m: float, spans: Floats
) -> tuple[float, float]:
    """The smallest distance of one motion and when, if it is below `best` at `when`; else these.

    From both ends of a span the distance closes at most at a known speed. So it is not less than where the two lines
    cross, and that is where it is looked at next. The first look is where the centres are nearest. `spans` is work
    space: begin, distance and speed there; end, distance and speed there.
    """
    t, depth = nearest_centres(m)[0], 0
    nearest, after, before = _look(m, t, a, b, table, max(t - m.begin, m.end - t))
    if nearest < best:
        best, when = max(nearest, 0.0), t
    for edge, closing in ((m.begin, before), (m.end, after)):
        if nearest - closing * abs(edge - t) >= best - accuracy_m:
            continue
        at_edge, after_edge, before_edge = _look(m, edge, a, b, table, abs(edge - t))
        if at_edge < best:
            best, when = max(at_edge, 0.0), edge
        if edge < t:
            _set_span(spans[depth], edge, at_edge, after_edge, t, nearest, before)
        else:
            _set_span(spans[depth], t, nearest, after, edge, at_edge, before_edge)
        depth += 1
    while depth and best > 0.0:
        depth -= 1
        begin, first, after, end, last, before = spans[depth]
        crosses = (first - last + after * begin + before * end) / max(after + before, TINY_MPS)
        if first - after * (crosses - begin) >= best - accuracy_m or depth + 2 > len(spans):
            continue
        t = min(max(crosses, begin + EDGE * (end - begin)), end - EDGE * (end - begin))
        nearest, after_t, before_t = _look(m, t, a, b, table, max(t - begin, end - t))
        if nearest < best:
            best, when = max(nearest, 0.0), t
        _set_span(spans[depth + 1], t, nearest, after_t, end, last, before)
        _set_span(spans[depth], begin, first, after, t, nearest, before_t)
        depth += 2
    return best, when


@inner
def _smallest(
    motions: Motions, a: Body, b: Body, table: Table, accuracy_m: float, spans: Floats
) -> tuple[float, float]:
    """As `narrowphase.smallest`, by fewer looks."""
    best, when = inf, 0.0
    for m in motions:
        best, when = _smallest_of_one(m, a, b, table, best, when, accuracy_m, spans)
        if best == 0.0:
            break
    return best, when


@inner
def _set_pose(pose: Floats, m: Any, t: float, bridge: Bridge) -> None:
    into = t - m.begin
    dx, dy, yaw = m.dx + m.vx * into, m.dy + m.vy * into, m.yaw_a + m.turn_a * into
    c, s = cos(yaw), sin(yaw)
    pose[0], pose[1], pose[2] = c * dx + s * dy, c * dy - s * dx, m.yaw_b + m.turn_b * into - yaw
    pose[3], pose[4] = bridge


@kernel((_PAIR[::1], FLOATS, *_FLOOR, _TWO, *_TABLE, *[FLOAT] * 3, INT))
def shape_contacts(
    pairs: Pairs,
    since: Floats,
    boxes: NDArray[Any],
    robots: Robots,
    knots: Knots,
    span: Span,
    begins: Ints,
    all_pieces: NDArray[Any],
    all_corners: NDArray[Any],
    target_m: float,
    tolerance_m: float,
    accuracy_m: float,
    rounds: int,
) -> tuple[Contacts, Poses]:
    """The contact of each pair of boxes within `span`, from `since` (pairs,) seconds into the slab on; and the poses
    at the contacts. Separations are left out if their accuracy is infinite."""
    contacts, poses = np.empty(len(pairs), CONTACT), np.empty((len(pairs), 5))
    motions, spans = np.empty(16, MOTION), np.empty((MOST_SPANS, 6))
    table = table_of(begins, all_pieces, all_corners)
    for at in range(len(pairs)):
        pair, contact = pairs[at], contacts[at]
        a, b = body_of(robots[pair.a], table, 0), body_of(robots[pair.b], table, 1)
        there = both_there(boxes, robots, knots, pair)
        motions, n, _ = motions_in_slab(boxes, robots, knots, pair, there, span, target_m + tolerance_m, motions)
        contact.contact, contact.open = inf, inf
        for m in motions[:n]:
            t, state, bridge = _first_contact(m, since[at], a, b, table, target_m, tolerance_m, rounds)
            if state != CLEAR:
                _set_pose(poses[at], m, t, bridge)
                contact.contact, contact.open = (t, inf) if state == MET else (inf, t)
                break
        if contact.contact < inf and accuracy_m < inf:
            contact.separation, contact.separation_at = _smallest(motions[:n], a, b, table, accuracy_m, spans)
    return contacts, poses


@kernel(_TWO(_ROBOT[::1], numba.from_dtype(MOTION)[::1], *_TABLE, FLOAT))
def smallest_of_shapes(
    two: Robots, motions: Motions, begins: Ints, pieces: NDArray[Any], corners: NDArray[Any], accuracy_m: float
) -> tuple[float, float]:
    """The smallest distance of two robots over all of `motions`, to the accuracy, and when."""
    table = table_of(begins, pieces, corners)
    a, b = body_of(two[0], table, 0), body_of(two[1], table, 1)
    return _smallest(motions, a, b, table, accuracy_m, np.empty((MOST_SPANS, 6)))


@kernel(FLOATS(INTS, INTS, FLOATS, *_FLOOR, *_TABLE, FLOAT))
def shape_distances(
    a: Ints,
    b: Ints,
    most_m: Floats,
    boxes: NDArray[Any],
    robots: Robots,
    knots: Knots,
    begins: Ints,
    pieces: NDArray[Any],
    corners: NDArray[Any],
    now_s: float,
) -> Floats:
    """(p,) distance of the robots `a` (p,) and `b` (p,) at `now_s`, or when the later of the two appears; inf on
    different floors, or if the circles around the two are `most_m` (p,) apart."""
    apart_m, places, motion = np.empty(len(a)), np.empty(len(robots), PLACE), np.zeros(1, MOTION)
    table, m = table_of(begins, pieces, corners), motion[0]
    for at in range(len(a)):
        places[a[at]].t = places[b[at]].t = inf
    for at in range(len(a)):
        apart_m[at] = inf
        if not are_on_one_floor(a[at], b[at], boxes, robots, knots, now_s, places):
            continue
        p, q = places[a[at]], places[b[at]]
        m.dx, m.dy, m.cos_a, m.sin_a, m.cos_b, m.sin_b = q.x - p.x, q.y - p.y, p.cos, p.sin, q.cos, q.sin
        if sqrt(m.dx * m.dx + m.dy * m.dy) - robots[a[at]].radius - robots[b[at]].radius >= most_m[at]:
            continue
        bodies = body_of(robots[a[at]], table, 0), body_of(robots[b[at]], table, 1)
        apart_m[at] = max(gap(m, 0.0, bodies[0], bodies[1], table, 0.0, 0.0)[0][0], 0.0)
    return apart_m
