"""The narrow phase: the first contact of two envelopes in one slab, and their smallest separation.

First contact is found by certified advancement. Along a fixed direction n, the gap closes at most at the speed
-v.n + |wA| rA + |wB| rB, so there is no contact for at least (gap - target) divided by that speed (conservative
advancement, Mirtich 1996, with a directional bound). Any n is valid. The axes of the sides are cheap and settle most
pairs at once. The direction between the closest features, along which the gap is the distance, settles the others. The
smallest separation is found by branch and bound with the same bound.

The file is long because all of it is one compiled calculation: motions from knots, distances, advancement and bound
are inlined into the kernels at its end. Kernels take boxes, robots and knots as separate arrays of records.
"""

from math import copysign, cos, floor, inf, sin, sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.broadphase import BOX, PAIR, Pairs
from deconflict.sweep.geometry.envelope_distances import nearest_corner
from deconflict.sweep.geometry.knots import KNOT, ROBOT, Knots, Robots
from ingest.batch import Floats, Ints
from ingest.kernels import FLOAT, FLOATS, INT, INTS, inner, kernel

TINY_MPS = 1e-12
NEAR_M = 0.02
"""This near the target, the exact distance is computed."""
MOST_HALVINGS = 40
"""Branch and bound halves a motion at most this many times."""
BLOCK = 32
"""The first knots of this many pairs are read together, so that the waits for memory overlap."""
CLEAR, MET, OPEN = 0, 1, 2
"""Results of advancement: no contact, contact, and undecided."""

MOTION = np.dtype(
    [
        ("begin", np.float64),  # seconds into the slab
        ("end", np.float64),
        ("dx", np.float64),  # from A's centre to B's, at `begin`
        ("dy", np.float64),
        ("vx", np.float64),  # velocity of B relative to A
        ("vy", np.float64),
        ("yaw_a", np.float64),  # headings at `begin`
        ("yaw_b", np.float64),
        ("turn_a", np.float64),  # turning rates, radians a second
        ("turn_b", np.float64),
        ("cos_a", np.float64),  # of the headings at `begin`
        ("sin_a", np.float64),
        ("cos_b", np.float64),
        ("sin_b", np.float64),
        ("length_a", np.float64),  # half sides
        ("width_a", np.float64),
        ("length_b", np.float64),
        ("width_b", np.float64),
        ("swing", np.float64),  # highest speed at which turning alone can close a gap, metres a second
    ],
    align=True,
)
"""A rectangle B that moves past another one, A, along a straight line and turning evenly."""

CONTACT = np.dtype(
    [
        ("contact", np.float64),  # first contact, inf if there is none
        ("separation", np.float64),  # smallest separation, if there is contact
        ("separation_at", np.float64),  # when that is
        ("open", np.float64),  # from when on contact is undecided, inf if it is decided
    ],
    align=True,
)
"""The contact of one pair. Times are seconds into the slab."""

PLACE = np.dtype(
    [
        ("t", np.float64),
        ("x", np.float64),  # centre at `t`
        ("y", np.float64),
        ("cos", np.float64),  # of the heading
        ("sin", np.float64),
        ("floor", np.int64),
    ],
    align=True,
)
"""The place of a robot at one moment."""

Motions = NDArray[Any]
"""Of `MOTION`."""
Two = tuple[float, float]
Span = Two
"""Times since the epoch, from and until."""
Contacts = NDArray[Any]
"""Of `CONTACT`."""

_BOX, _KNOT, _ROBOT, _PAIR = (numba.from_dtype(dtype) for dtype in (BOX, KNOT, ROBOT, PAIR))
_TWO = numba.types.UniTuple(FLOAT, 2)  # type: ignore[no-untyped-call]
_MOTION, _CONTACT = numba.from_dtype(MOTION), numba.from_dtype(CONTACT)


@inner
def turned(m: Any, into: float) -> tuple[float, float, float, float]:
    """Cosine and sine of A's heading, and of B's, `into` seconds after `begin`."""
    ca, sa, cb, sb = m.cos_a, m.sin_a, m.cos_b, m.sin_b
    if m.turn_a != 0.0:
        yaw = m.yaw_a + m.turn_a * into
        ca, sa = cos(yaw), sin(yaw)
    if m.turn_b != 0.0:
        yaw = m.yaw_b + m.turn_b * into
        cb, sb = cos(yaw), sin(yaw)
    return ca, sa, cb, sb


@inner
def _between(
    dx: float, dy: float, facing_a: Two, facing_b: Two, half_a: Two, half_b: Two
) -> tuple[float, float, float]:
    """The distance of rectangle B from A, and the unit vector between the closest features; all 0 if they overlap.

    (dx, dy) is from centre to centre. `facing` is the cosine and sine of a heading. Two convex polygons that do not
    overlap are closest at a corner of one of them. The four axes of their sides show whether they overlap (Gottschalk,
    Lin and Manocha 1996, in the plane).
    """
    (ca, sa), (cb, sb), (length_a, width_a), (length_b, width_b) = facing_a, facing_b, half_a, half_b
    c, s = ca * cb + sa * sb, ca * sb - sa * cb
    ax, ay = ca * dx + sa * dy, ca * dy - sa * dx
    bx, by = -(cb * dx + sb * dy), -(cb * dy - sb * dx)
    if (
        abs(ax) <= length_a + length_b * abs(c) + width_b * abs(s)
        and abs(ay) <= width_a + length_b * abs(s) + width_b * abs(c)
        and abs(bx) <= length_b + length_a * abs(c) + width_a * abs(s)
        and abs(by) <= width_b + length_a * abs(s) + width_a * abs(c)
    ):
        return 0.0, 0.0, 0.0
    of_b, px, py = nearest_corner(ax, ay, c, s, length_b, width_b, length_a, width_a)
    of_a, qx, qy = nearest_corner(bx, by, c, -s, length_a, width_a, length_b, width_b)
    distance = sqrt(min(of_b, of_a))
    if distance == 0.0:
        return 0.0, 0.0, 0.0
    if of_b <= of_a:
        return distance, (ca * px - sa * py) / distance, (sa * px + ca * py) / distance
    return distance, -(cb * qx - sb * qy) / distance, -(sb * qx + cb * qy) / distance


@inner
def gap(m: Any, t: float) -> tuple[float, float, float]:
    """The distance at `t`, and the unit vector between the closest features, from A to B; all 0 if they overlap."""
    into = t - m.begin
    ca, sa, cb, sb = turned(m, into)
    half_a, half_b = (m.length_a, m.width_a), (m.length_b, m.width_b)
    return _between(m.dx + m.vx * into, m.dy + m.vy * into, (ca, sa), (cb, sb), half_a, half_b)


@inner
def _along(
    m: Any, dx: float, dy: float, ux: float, uy: float, near: float, far: float, target_m: float
) -> tuple[float, float]:
    """The gap along the unit vector (ux, uy), and for how long it surely stays above the target. Along that vector the
    rectangles reach `near` and `far` from their centres."""
    at = ux * dx + uy * dy
    gap_m = abs(at) - near - far
    closing = m.swing - copysign(1.0, at) * (ux * m.vx + uy * m.vy)
    return gap_m, (gap_m - target_m) / max(closing, TINY_MPS)


@inner
def apart(m: Any, t: float, target_m: float) -> tuple[float, float]:
    """The widest gap at `t` along any axis of the sides, and for how long the distance surely stays above the target.

    The gap is never more than the distance, and negative if the two overlap. The duration is 0 if no axis shows any.
    """
    into = t - m.begin
    dx, dy = m.dx + m.vx * into, m.dy + m.vy * into
    ca, sa, cb, sb = turned(m, into)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    along_a = _along(m, dx, dy, ca, sa, m.length_a, m.length_b * c + m.width_b * s, target_m)
    across_a = _along(m, dx, dy, -sa, ca, m.width_a, m.length_b * s + m.width_b * c, target_m)
    along_b = _along(m, dx, dy, cb, sb, m.length_b, m.length_a * c + m.width_a * s, target_m)
    across_b = _along(m, dx, dy, -sb, cb, m.width_b, m.length_a * s + m.width_a * c, target_m)
    widest_m = max(along_a[0], across_a[0], along_b[0], across_b[0])
    return widest_m, max(along_a[1], across_a[1], along_b[1], across_b[1], 0.0)


@inner
def nearest_centres(m: Any) -> tuple[float, float]:
    """When the centres are nearest to each other, and their distance at that time."""
    speed_squared = m.vx * m.vx + m.vy * m.vy
    into = -(m.dx * m.vx + m.dy * m.vy) / speed_squared if speed_squared > 0.0 else 0.0
    into = min(max(into, 0.0), m.end - m.begin)
    x, y = m.dx + m.vx * into, m.dy + m.vy * into
    return m.begin + into, sqrt(x * x + y * y)


@inner
def first_contact(m: Any, target_m: float, tolerance_m: float, rounds: int) -> tuple[float, int]:
    """A time and a result: `MET` at the first time within the target, to the tolerance and never late; `CLEAR`; or
    `OPEN` from that time on."""
    aim_m, close_m, t = target_m + tolerance_m / 4, target_m + tolerance_m / 2, m.begin
    for _ in range(rounds):
        widest, step = apart(m, t, aim_m)
        if widest <= 0.0:
            return t, MET
        if widest <= close_m + NEAR_M and t + step <= m.end:
            distance, nx, ny = gap(m, t)
            if distance <= close_m:
                return t, MET
            step = max(step, (distance - aim_m) / max(m.swing - (m.vx * nx + m.vy * ny), TINY_MPS))
        t += step
        if t > m.end:
            return t, CLEAR
    return t, OPEN


@inner
def _smallest_of_one(
    m: Any, best: float, when: float, accuracy_m: float, lows: Floats, highs: Floats
) -> tuple[float, float]:
    """The smallest distance of one motion and when, if it is below `best` at `when`; else these. `lows` and `highs` are
    work space."""
    lows[0], highs[0], depth = m.begin, m.end, 1
    while depth and best > 0.0:
        depth -= 1
        low, high = lows[depth], highs[depth]
        middle, half = (low + high) / 2, (high - low) / 2
        distance, nx, ny = gap(m, middle)
        if distance < best:
            best, when = distance, middle
        opening = m.vx * nx + m.vy * ny
        for begin, end, closing in ((middle, high, m.swing - opening), (low, middle, m.swing + opening)):
            if distance - max(closing, 0.0) * half < best - accuracy_m and depth < len(lows):
                lows[depth], highs[depth] = begin, end
                depth += 1
    return best, when


@inner
def smallest(motions: Motions, accuracy_m: float, lows: Floats, highs: Floats) -> tuple[float, float]:
    """The smallest distance over all of `motions`, to the accuracy, and when; 0 if the rectangles overlap.

    `lows` and `highs`, of length `MOST_HALVINGS`, are work space.
    """
    best, when = inf, 0.0
    for m in motions:
        t, _ = nearest_centres(m)
        distance, _, _ = gap(m, t)
        if distance < best:
            best, when = distance, t
        if best == 0.0:
            return best, when
    for m in motions:
        for t in (m.begin, m.end):
            distance, _, _ = gap(m, t)
            if distance < best:
                best, when = distance, t
    for m in motions:
        best, when = _smallest_of_one(m, best, when, accuracy_m, lows, highs)
    return best, when


@inner
def _until(knots: Knots, k: int, end: int, slab: int) -> float:
    """When the motion from knot `k` ends, or the slab, in seconds into the slab."""
    return min(knots[k + 1].t - slab, 1.0) if k + 1 < end else 1.0


@inner
def _set_motion(
    m: Any, a: Any, b: Any, of_a: Any, of_b: Any, slab: int, begin: float, end: float, within_m: float
) -> bool:
    """Set the motion of robot `b` past robot `a`, from their knots `of_b` and `of_a` on. A's centre is subtracted
    before anything else.

    Returns False, and sets not all fields, if their circles stay further apart than `within_m`.
    """
    into_a, into_b = (slab - of_a.t) + begin, (slab - of_b.t) + begin
    m.begin, m.end = begin, end
    m.dx = (of_b.x - of_a.x) + (of_b.vx * into_b - of_a.vx * into_a)
    m.dy = (of_b.y - of_a.y) + (of_b.vy * into_b - of_a.vy * into_a)
    m.vx, m.vy = of_b.vx - of_a.vx, of_b.vy - of_a.vy
    if nearest_centres(m)[1] > a.radius + b.radius + within_m:
        return False
    m.yaw_a, m.yaw_b = of_a.yaw + of_a.turn * into_a, of_b.yaw + of_b.turn * into_b
    m.turn_a, m.turn_b = of_a.turn, of_b.turn
    m.cos_a, m.sin_a, m.cos_b, m.sin_b = cos(m.yaw_a), sin(m.yaw_a), cos(m.yaw_b), sin(m.yaw_b)
    m.length_a, m.width_a, m.length_b, m.width_b = a.half_length, a.half_width, b.half_length, b.half_width
    m.swing = abs(of_a.turn) * a.radius + abs(of_b.turn) * b.radius
    return True


@inner
def both_there(boxes: NDArray[Any], robots: Robots, knots: Knots, pair: Any) -> float:
    """From when on both robots of a pair are present in its slab, in seconds into the slab."""
    box_a, box_b = boxes[pair.ring, pair.a], boxes[pair.ring, pair.b]
    of_a, of_b = knots[robots[pair.a].first + box_a.knot], knots[robots[pair.b].first + box_b.knot]
    return float(max(of_a.t - box_a.slab, of_b.t - box_a.slab, 0.0))


@inner
def motions_in_slab(
    boxes: NDArray[Any],
    robots: Robots,
    knots: Knots,
    pair: Any,
    there: float,
    span: Span,
    within_m: float,
    motions: Motions,
) -> tuple[Motions, int, int]:
    """The motions of a pair in its slab, from `there` on and in `span`, in order, whose circles come within `within_m`.

    They are written to `motions`, which may grow. Returns that array, the number of motions in it, and their number
    without the limit of distance.
    """
    box_a, box_b, a, b = boxes[pair.ring, pair.a], boxes[pair.ring, pair.b], robots[pair.a], robots[pair.b]
    slab, n, looked_at = box_a.slab, 0, 0
    low, high = span[0] - slab, span[1] - slab
    ka, kb, end_a, end_b = a.first + box_a.knot, b.first + box_b.knot, a.first + a.count, b.first + b.count
    t = there
    while t < 1.0:
        while _until(knots, ka, end_a, slab) <= t:
            ka += 1
        while _until(knots, kb, end_b, slab) <= t:
            kb += 1
        until = min(_until(knots, ka, end_a, slab), _until(knots, kb, end_b, slab))
        begin, end, on_floor = max(t, low), min(until, high), knots[ka].floor
        if begin <= end and on_floor >= 0 and on_floor == knots[kb].floor:
            if n == len(motions):
                motions = np.concatenate((motions, np.empty(n, MOTION)))
            looked_at += 1
            n += _set_motion(motions[n], a, b, knots[ka], knots[kb], slab, begin, end, within_m)
        t = until
    return motions, n, looked_at


@inner
def _first_of(motions: Motions, target_m: float, tolerance_m: float, rounds: int) -> Two:
    """The first contact of motions in order, inf if there is none; and from when on it is undecided, inf if it is
    not."""
    for m in motions:
        t, state = first_contact(m, target_m, tolerance_m, rounds)
        if state == MET:
            return t, inf
        if state == OPEN:
            return inf, t
    return inf, inf


_OF_PAIRS = (_PAIR[::1], _BOX[:, ::1], _ROBOT[::1], _KNOT[::1])


@kernel((*_OF_PAIRS, _TWO, *[FLOAT] * 3, INT))
def find_contacts(
    pairs: Pairs,
    boxes: NDArray[Any],
    robots: Robots,
    knots: Knots,
    span: Span,
    target_m: float,
    tolerance_m: float,
    accuracy_m: float,
    rounds: int,
) -> tuple[Contacts, int, int, int]:
    """The contact of each pair of boxes within `span`; and how many pairs are undecided, how many motions they have,
    and how many of these have circles that come near enough for advancement. A pair with a shape is undecided from when
    on the rectangles around the two are in contact."""
    contacts, opened, all_motions, advanced = np.empty(len(pairs), CONTACT), 0, 0, 0
    motions, lows, highs = np.empty(16, MOTION), np.empty(MOST_HALVINGS), np.empty(MOST_HALVINGS)
    there = np.empty(BLOCK)
    for at in range(len(pairs)):
        if at % BLOCK == 0:
            for ahead in range(min(BLOCK, len(pairs) - at)):
                there[ahead] = both_there(boxes, robots, knots, pairs[at + ahead])
        motions, n, near_or_far = motions_in_slab(
            boxes, robots, knots, pairs[at], there[at % BLOCK], span, target_m + tolerance_m, motions
        )
        all_motions, advanced = all_motions + near_or_far, advanced + n
        contact = contacts[at]
        contact.contact, contact.open = _first_of(motions[:n], target_m, tolerance_m, rounds)
        if robots[pairs[at].a].shape or robots[pairs[at].b].shape:
            contact.contact, contact.open = inf, min(contact.contact, contact.open)
        opened += contact.open < inf
        if contact.contact < inf:
            contact.separation, contact.separation_at = smallest(motions[:n], accuracy_m, lows, highs)
    return contacts, opened, all_motions, advanced


@kernel(_MOTION[::1](_PAIR[::1], _BOX[:, ::1], _ROBOT[::1], _KNOT[::1], _TWO))
def motions_of(pairs: Pairs, boxes: NDArray[Any], robots: Robots, knots: Knots, span: Span) -> Motions:
    """The motions of the single pair in `pairs`, within `span`."""
    there = both_there(boxes, robots, knots, pairs[0])
    motions, n, _ = motions_in_slab(boxes, robots, knots, pairs[0], there, span, inf, np.empty(16, MOTION))
    return motions[:n].copy()


@kernel(_TWO(_MOTION[::1], FLOAT))
def smallest_separation(motions: Motions, accuracy_m: float) -> tuple[float, float]:
    """The smallest distance over all of `motions`, to the accuracy, and when; see `smallest`."""
    return smallest(motions, accuracy_m, np.empty(MOST_HALVINGS), np.empty(MOST_HALVINGS))


@inner
def set_place(place: Any, box: Any, robot: Any, knots: Knots, t: float) -> None:
    """Set the place of a robot at `t`, which is in the slab of `box`."""
    k, last = robot.first + box.knot, robot.first + robot.count - 1
    while k < last and knots[k + 1].t <= t:
        k += 1
    knot, into = knots[k], t - knots[k].t
    yaw = knot.yaw + knot.turn * into
    place.t, place.floor = t, knot.floor
    place.x, place.y, place.cos, place.sin = knot.x + knot.vx * into, knot.y + knot.vy * into, cos(yaw), sin(yaw)


@inner
def are_on_one_floor(
    a: int, b: int, boxes: NDArray[Any], robots: Robots, knots: Knots, now_s: float, places: NDArray[Any]
) -> bool:
    """Set the places of two robots at `now_s`, or when the later of them appears. Whether both are on one floor then.

    The place of a robot is computed only if `places` does not have it for that time.
    """
    t = max(now_s, robots[a].appears, robots[b].appears)
    for slot in (a, b):
        if places[slot].t != t:
            set_place(places[slot], boxes[floor(t) % len(boxes), slot], robots[slot], knots, t)
    return bool(places[a].floor >= 0 and places[a].floor == places[b].floor)


@inner
def _start_distance(
    a: int, b: int, boxes: NDArray[Any], robots: Robots, knots: Knots, now_s: float, places: NDArray[Any]
) -> float:
    """Distance of two robots at `now_s`, or when the later of them appears; inf on different floors."""
    if not are_on_one_floor(a, b, boxes, robots, knots, now_s, places):
        return inf
    p, q, robot_a, robot_b = places[a], places[b], robots[a], robots[b]
    half_a, half_b = (robot_a.half_length, robot_a.half_width), (robot_b.half_length, robot_b.half_width)
    return _between(q.x - p.x, q.y - p.y, (p.cos, p.sin), (q.cos, q.sin), half_a, half_b)[0]


@kernel(FLOATS(INTS, INTS, *_OF_PAIRS[1:], FLOAT))
def start_distances(a: Ints, b: Ints, boxes: NDArray[Any], robots: Robots, knots: Knots, now_s: float) -> Floats:
    """(p,) distance of the robots `a` (p,) and `b` (p,) at `now_s`, or when the later of each two appears; inf on
    different floors. The place of a robot is computed once for all its pairs, in the order of slots."""
    apart_m, places, wanted = np.empty(len(a)), np.empty(len(robots), PLACE), np.zeros(len(robots), np.bool_)
    for at in range(len(a)):
        wanted[a[at]] = wanted[b[at]] = True
    for slot in np.flatnonzero(wanted):
        t = max(now_s, robots[slot].appears)
        set_place(places[slot], boxes[floor(t) % len(boxes), slot], robots[slot], knots, t)
    for at in range(len(a)):
        apart_m[at] = _start_distance(a[at], b[at], boxes, robots, knots, now_s, places)
    return apart_m


@kernel((_OF_PAIRS[0], INTS, *_OF_PAIRS[1:], FLOAT, FLOATS, *[FLOAT] * 2, INT))
def first_contacts_of(
    pairs: Pairs,
    pair_of: Ints,
    boxes: NDArray[Any],
    robots: Robots,
    knots: Knots,
    now_s: float,
    until_s: Floats,
    target_m: float,
    tolerance_m: float,
    rounds: int,
) -> tuple[Floats, Floats, Floats, int]:
    """The first contacts of p pairs in [`now_s`, `until_s` (p,)], by their pairs of boxes `pairs` (n,) in the order of
    time.

    `pair_of` (n,) is the row of each one's pair. Boxes after the first contact of their pair are left out.

    Returns (p,) the first contact of each pair, inf if there is none; (p,) its distance at `now_s`, inf if there is no
    contact and none undecided; (n,) from when on the contact of two boxes is undecided, inf if it is decided; and how
    many are undecided.
    """
    contact_s, start_m, open_ = np.full(len(until_s), inf), np.full(len(until_s), inf), np.full(len(pairs), inf)
    motions, places, opened = np.empty(16, MOTION), np.empty(len(robots), PLACE), 0
    for slot in range(len(places)):
        places[slot].t = inf
    for at in range(len(pairs)):
        pair, row = pairs[at], pair_of[at]
        if contact_s[row] < inf:
            continue
        there, span = both_there(boxes, robots, knots, pair), (now_s, until_s[row])
        motions, n, _ = motions_in_slab(boxes, robots, knots, pair, there, span, target_m + tolerance_m, motions)
        t, open_[at] = _first_of(motions[:n], target_m, tolerance_m, rounds)
        if robots[pair.a].shape or robots[pair.b].shape:
            t, open_[at] = inf, min(t, open_[at])
        opened += open_[at] < inf
        if t < inf or open_[at] < inf:
            contact_s[row] = max(boxes[pair.ring, pair.a].slab + t, now_s)
            start_m[row] = _start_distance(pair.a, pair.b, boxes, robots, knots, now_s, places)
    return contact_s, start_m, open_, opened
