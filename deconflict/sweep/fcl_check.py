"""First contact by FCL, for pairs that advancement leaves open. Shapes are in `deconflict/sweep/shapes/fcl_shapes.py`.

`fcl.collide` of two boxes is exact. `continuousCollide` and `distance` are not reliable (docs/sweep.md). Two boxes and
two objects are made once and moved, since each object leaks some memory. Only return values are read.
"""

from collections.abc import Iterable
from math import cos, hypot, inf, sin
from typing import Any, Protocol

import fcl
import numpy as np

from deconflict.sweep.narrowphase import MOTION, Motions

HEIGHT_M = 1.0
"""Height of both boxes. The question is two-dimensional, and FCL answers it exactly if the heights are equal."""

_BOXES = (fcl.Box(1.0, 1.0, HEIGHT_M), fcl.Box(1.0, 1.0, HEIGHT_M))
_OBJECTS = tuple(fcl.CollisionObject(box, fcl.Transform()) for box in _BOXES)
_REQUEST = fcl.CollisionRequest()


class MovingPair(Protocol):
    """Two robots of which B moves past A along a straight line, both turning evenly."""

    @property
    def begin(self) -> float: ...
    @property
    def end(self) -> float: ...
    @property
    def speed(self) -> float:
        """The highest speed of any point of B, as A sees it."""

    def is_within(self, t: float, limit_m: float) -> bool:
        """Whether the two are within a distance at `t`. It may say so up to a fifth of a millimetre beyond."""


class FclCheck:
    """Finds the first contact by halving the time; FCL excludes intervals without contact."""

    def __init__(self, target_m: float, tolerance_m: float) -> None:
        """A contact is the first time at which the distance is within `tolerance_m` of `target_m`."""
        self.target_m, self.tolerance_m = target_m, tolerance_m
        self.calls = 0
        """Calls of FCL."""

    def first_contact(self, motions: Motions, from_t: float) -> float:
        """The first time after `from_t` within the target distance, to the tolerance; inf if there is none. Motions are
        in the order of time."""
        return self.first_of(map(_MovingRectangles, motions), from_t)

    def first_of(self, pairs: Iterable[MovingPair], from_t: float) -> float:
        """The same for any two robots, given by their motions."""
        return next((t for pair in pairs if (t := self._in_one(pair, from_t)) < inf), inf)

    def _in_one(self, pair: MovingPair, from_t: float) -> float:
        """Over [a, b], no point of B moves further from its place at the middle, as A sees it, than R = (|v| + |w| r)(b
        - a) / 2. If A grown by R and the target does not touch B there, there is no contact in [a, b]."""
        stack: list[tuple[float, float]] = [(max(from_t, pair.begin), pair.end)] if from_t <= pair.end else []
        while stack:
            a, b = stack.pop()
            middle, reach = (a + b) / 2, pair.speed * (b - a) / 2
            self.calls += 1
            if not pair.is_within(middle, self.target_m + reach):
                continue
            if reach <= 0.35 * self.tolerance_m:
                return a
            stack += [(middle, b), (a, middle)]
        return inf


class _MovingRectangles:
    """One `MOTION` in plain numbers."""

    def __init__(self, motion: Any) -> None:
        m = dict(zip(MOTION.names or (), motion.item(), strict=True))
        self.begin: float = m["begin"]
        self.end: float = m["end"]
        self.dx, self.dy, self.vx, self.vy = m["dx"], m["dy"], m["vx"], m["vy"]
        self.yaws, self.turns = (m["yaw_a"], m["yaw_b"]), (m["turn_a"], m["turn_b"])
        self.halves = (m["length_a"], m["width_a"]), (m["length_b"], m["width_b"])
        radii = [hypot(*half) for half in self.halves]
        self.speed = hypot(self.vx, self.vy) + sum(abs(w) * r for w, r in zip(self.turns, radii, strict=True))

    def is_within(self, t: float, limit_m: float) -> bool:
        """A's sides grow by the limit. Near its corners the distance decides, unless the two overlap."""
        if not self._touches(t, limit_m):
            return False
        return limit_m == 0.0 or self._touches(t, 0.0) or self._distance(t) <= limit_m

    def _touches(self, t: float, grow_m: float) -> bool:
        """Whether A, its sides grown by `grow_m`, touches B at `t`."""
        into = t - self.begin
        for box, half, grown in zip(_BOXES, self.halves, (grow_m, 0.0), strict=True):
            box.side = np.array([2 * (half[0] + grown), 2 * (half[1] + grown), HEIGHT_M])
        yaw_a, yaw_b = self._yaws(into)
        _move(_OBJECTS[0], 0.0, 0.0, yaw_a)
        _move(_OBJECTS[1], self.dx + self.vx * into, self.dy + self.vy * into, yaw_b)
        return bool(fcl.collide(*_OBJECTS, _REQUEST, fcl.CollisionResult()))

    def _distance(self, t: float) -> float:
        """Distance at `t` of rectangles that do not overlap: from a corner of one to the other; see
        `narrowphase.gap`."""
        into = t - self.begin
        x, y = self.dx + self.vx * into, self.dy + self.vy * into
        (yaw_a, yaw_b), (a, b) = self._yaws(into), self.halves
        return min(_corner_distance(x, y, yaw_a, yaw_b, a, b), _corner_distance(-x, -y, yaw_b, yaw_a, b, a))

    def _yaws(self, into: float) -> tuple[float, float]:
        return self.yaws[0] + self.turns[0] * into, self.yaws[1] + self.turns[1] * into


def _move(body: fcl.CollisionObject, x: float, y: float, yaw: float) -> None:
    body.setTranslation(np.array([x, y, 0.0]))
    body.setQuatRotation(np.array([cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)]))


def _corner_distance(
    x: float, y: float, yaw: float, other_yaw: float, half: tuple[float, ...], other_half: tuple[float, ...]
) -> float:
    """Distance from the rectangle at the origin to the nearest corner of the other one, at (x, y)."""
    c, s = cos(yaw), sin(yaw)
    cx, cy = c * x + s * y, c * y - s * x
    c, s = cos(other_yaw - yaw), sin(other_yaw - yaw)
    corners = ((i * other_half[0], j * other_half[1]) for i in (1, -1) for j in (1, -1))
    return min(
        hypot(max(abs(cx + u * c - w * s) - half[0], 0.0), max(abs(cy + u * s + w * c) - half[1], 0.0))
        for u, w in corners
    )
