"""FCL's decision whether two shapes come within a distance.

Polygons are prisms of triangles, circles are cylinders, rectangles are boxes. `fcl.collide` of these was never wrong in
trials; `fcl.Convex` was, so it is not used. A mesh is a surface, and two surfaces do not touch if one shape is wholly
inside the other. So the prisms of robot B begin at half the height of those of robot A: then the walls of the inner one
cross a lid of the outer one.

Making a mesh costs far more than a call, so meshes are kept, and growths are rounded up.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import acos, ceil, cos, frexp, hypot, inf, ldexp, pi, sin
from typing import Any, NamedTuple

import fcl
import numpy as np
import shapely

from deconflict.sweep.narrowphase import MOTION
from deconflict.sweep.shapes.shape_table import SHAPES
from ingest.batch import Bools, Floats
from ingest.shapes import Shape, ShapePart

TALL_M = 2.0
"""Height of each prism."""
LOW_M, HIGH_M = 0.0, TALL_M / 2
"""Where the prisms of A and of B begin."""
MIDDLE_M = HIGH_M + TALL_M / 2
"""The middle of B's prisms."""
ARC_M = 1e-4
"""A grown polygon is larger than it has to be by no more than this at its rounded corners."""
MOST_SEGMENTS = 64
"""Of a quarter circle."""
MOST_MESHES = 4096

_REQUEST = fcl.CollisionRequest()


class Solid(NamedTuple):
    """A robot of the slot table."""

    shape: int
    """Number of its shape; 0 for a rectangle."""
    half_length: float
    """Metres."""
    half_width: float
    grown: float
    """How much a shape is grown all around, metres."""
    bottom: float
    """Heights, metres."""
    top: float


class Placed(NamedTuple):
    """A body of FCL, and its place in the robot's frame."""

    body: fcl.CollisionObject
    x_m: float
    y_m: float
    bottom_m: float
    top_m: float


Bodies = tuple[Placed, ...]


def touch(a: Solid, b: Solid, pose: tuple[float, float, float], within_m: float) -> bool:
    """Whether two robots as reported, B at `pose` in the frame of A, are within a distance. A polygon is grown a little
    more than it has to be."""
    bodies_a = _bodies(a, within_m if a.shape else 0.0, LOW_M)
    bodies_b = _bodies(b, 0.0 if a.shape else within_m, HIGH_M)
    place, turn = _transforms(np.array([pose]))
    return _touch(bodies_a, bodies_b, place[0], turn[0])


def touches(pairs: Sequence[tuple[Solid, Solid]], poses: Floats) -> Bools:
    """(n,) whether two robots as reported touch, B at the pose (n, 3) in the frame of A."""
    low: dict[int, Bodies] = {}
    high: dict[int, Bodies] = {}
    answers = np.empty(len(pairs), bool)
    for row, ((a, b), place, turn) in enumerate(zip(pairs, *_transforms(poses), strict=True)):
        answers[row] = _touch(_kept_bodies(a, LOW_M, low), _kept_bodies(b, HIGH_M, high), place, turn)
    return answers


def _transforms(poses: Floats) -> tuple[Floats, Floats]:
    """The translations (n, 3) and rotations (n, 4) of B at poses (n, 3)."""
    x, y, yaw = poses.T
    place = np.column_stack([x, y, np.full(len(poses), MIDDLE_M)])
    return place, np.column_stack([np.cos(yaw / 2), np.zeros((len(poses), 2)), np.sin(yaw / 2)])


def _touch(bodies_a: Bodies, bodies_b: Bodies, place: Floats, turn: Floats) -> bool:
    for body_b, ahead_m, left_m, bottom_m, top_m in bodies_b:
        body_b.setTranslation(_moved(place, turn, ahead_m, left_m) if ahead_m or left_m else place)
        body_b.setQuatRotation(turn)
        for body_a, _, _, other_bottom_m, other_top_m in bodies_a:
            if bottom_m > other_top_m or other_bottom_m > top_m:
                continue
            if fcl.collide(body_a, body_b, _REQUEST, fcl.CollisionResult()):
                return True
    return False


def _moved(place: Floats, turn: Floats, ahead_m: float, left_m: float) -> Floats:
    """The place of a part of a turned robot."""
    c, s = turn[0] ** 2 - turn[3] ** 2, 2 * turn[0] * turn[3]
    return place + np.array((c * ahead_m - s * left_m, s * ahead_m + c * left_m, 0.0))


class MovingShapes:
    """A `MOTION` of two robots of which one is a shape: see `fcl_check.MovingPair`."""

    def __init__(self, motion: Any, a: Solid, b: Solid) -> None:
        m = dict(zip(MOTION.names or (), motion.item(), strict=True))
        self._m, self._a, self._b = m, a, b
        self.begin: float = m["begin"]
        self.end: float = m["end"]
        turning = abs(m["turn_a"]) * hypot(m["length_a"], m["width_a"])
        self.speed = hypot(m["vx"], m["vy"]) + turning + abs(m["turn_b"]) * hypot(m["length_b"], m["width_b"])

    def is_within(self, t: float, limit_m: float) -> bool:
        m, into = self._m, t - self.begin
        dx, dy, yaw = m["dx"] + m["vx"] * into, m["dy"] + m["vy"] * into, m["yaw_a"] + m["turn_a"] * into
        c, s = cos(yaw), sin(yaw)
        pose = c * dx + s * dy, c * dy - s * dx, m["yaw_b"] + m["turn_b"] * into - yaw
        return touch(self._a, self._b, pose, _rounded_up(limit_m + self._a.grown + self._b.grown))


def _rounded_up(growth_m: float) -> float:
    """A growth with four binary digits, so that meshes are used again, but no more than a tenth of a millimetre
    larger."""
    if growth_m <= 0.0:
        return 0.0
    _, power = frexp(growth_m)
    unit = min(ldexp(1.0, power - 4), ARC_M)
    return ceil(growth_m / unit) * unit


def _kept_bodies(solid: Solid, begins_m: float, kept: dict[int, Bodies]) -> Bodies:
    """The bodies of a robot as reported; those of a shape are the same each time."""
    bodies = kept.get(id(solid))
    if bodies is None:
        bodies = _bodies(solid, 0.0, begins_m)
        if solid.shape:
            kept[id(solid)] = bodies
    return bodies


def _bodies(solid: Solid, grow_m: float, begins_m: float) -> Bodies:
    if solid.shape:
        shape = SHAPES[solid.shape]
        assert shape is not None  # noqa: S101 - rectangles have no bodies of their own
        return _bodies_of_shape(shape, solid.bottom, solid.top, grow_m, begins_m)
    size_m = 2 * solid.half_length, 2 * solid.half_width
    if _BOX_SIZES_M.get(begins_m) != size_m:
        _BOXES[begins_m].side, _BOX_SIZES_M[begins_m] = np.array((*size_m, TALL_M)), size_m
    return (Placed(_BOX_BODIES[begins_m], 0.0, 0.0, solid.bottom, solid.top),)


@lru_cache(MOST_MESHES)
def _bodies_of_shape(shape: Shape, bottom_m: float, top_m: float, grow_m: float, begins_m: float) -> Bodies:
    return tuple(_placed(part, bottom_m, top_m, _body(part, grow_m, begins_m)) for part in shape.parts)


def _placed(part: ShapePart, bottom_m: float, top_m: float, body: fcl.CollisionObject) -> Placed:
    x_m, y_m = part.outline_m[0] if part.radius_m else (0.0, 0.0)
    if part.bottom_m > -inf and bottom_m > -inf:
        bottom_m, top_m = bottom_m + part.bottom_m, bottom_m + part.top_m
    return Placed(body, x_m, y_m, bottom_m, top_m)


_BOXES = {begins_m: fcl.Box(1.0, 1.0, TALL_M) for begins_m in (LOW_M, HIGH_M)}
_BOX_SIZES_M: dict[float, tuple[float, float]] = {}
"""Length and width of each box as it was last set."""
_BOX_BODIES = {
    begins_m: fcl.CollisionObject(box, fcl.Transform(np.array([0.0, 0.0, begins_m + TALL_M / 2])))
    for begins_m, box in _BOXES.items()
}


@lru_cache(MOST_MESHES)
def _body(part: ShapePart, grow_m: float, begins_m: float) -> fcl.CollisionObject:
    """The body of a part, grown all around, with its middle at half its height."""
    x_m, y_m = part.outline_m[0] if part.radius_m else (0.0, 0.0)
    form = fcl.Cylinder(part.radius_m + grow_m, TALL_M) if part.radius_m else _prism(_grown(part, grow_m), begins_m)
    return fcl.CollisionObject(form, fcl.Transform(np.array([x_m, y_m, begins_m + TALL_M / 2])))


def _grown(part: ShapePart, grow_m: float) -> shapely.Polygon:
    """A polygon that holds the part grown all around, and hardly more."""
    polygon = shapely.Polygon(part.outline_m)
    if grow_m <= 0.0:
        return polygon
    radius_m = grow_m + ARC_M
    segments = min(ceil(pi / 4 / acos(grow_m / radius_m)), MOST_SEGMENTS)
    return polygon.buffer(radius_m, quad_segs=segments)


def _prism(polygon: shapely.Polygon, begins_m: float) -> fcl.BVHModel:
    """The sides of a prism over a polygon as triangles, and the lid that is within the height of the other robot."""
    triangles = [
        list(triangle.exterior.coords)[:3] for triangle in shapely.constrained_delaunay_triangles(polygon).geoms
    ]
    ring = list(polygon.exterior.coords)[:-1]
    row = {corner: at for at, corner in enumerate(ring)}
    n, above = len(ring), len(ring) if begins_m == LOW_M else 0
    faces = [[row[corner] + above for corner in triangle] for triangle in triangles]
    for at in range(n):
        after = (at + 1) % n
        faces += [[at, after, n + at], [after, n + after, n + at]]
    corners = np.array([(x, y, z) for z in (-TALL_M / 2, TALL_M / 2) for x, y in ring])
    mesh = fcl.BVHModel()
    mesh.beginModel(len(corners), len(faces))
    mesh.addSubModel(corners, np.array(faces))
    mesh.endModel()
    return mesh
