"""FCL, where the numpy rounds leave a pair open. The only file that imports it.

`fcl.collide` of two boxes is exact; `continuousCollide` and `distance` are not to be relied on (docs/sweep.md). Two
boxes and two objects are made once and moved, since each object leaks a little; only return values are read.
"""

from math import cos, sin

import fcl
import numpy as np

from deconflict.relative import Relative

HEIGHT_M = 1.0
"""Of both boxes: the question is one of the plan, and heights must be equal for FCL to answer it exactly."""

_BOXES = (fcl.Box(1.0, 1.0, HEIGHT_M), fcl.Box(1.0, 1.0, HEIGHT_M))
_OBJECTS = tuple(fcl.CollisionObject(box, fcl.Transform()) for box in _BOXES)


class Decider:
    """First contact of pairs of segments by halving, FCL excluding what it can. Counts its `calls`."""

    def __init__(self, target_m: float, tolerance_m: float) -> None:
        self._target_m, self._tolerance_m = target_m, tolerance_m
        self.calls = 0

    def first_contact(self, motion: Relative, row: int, begin: float) -> float:
        """The first time after `begin` within the target, to the tolerance; inf for none.

        Over [a, b] no point of B moves further from where it is at the middle, as A sees it, than
        R = (|v| + |w| r)(b - a) / 2. If A grown by R and the target is clear of B there, so is all of [a, b].
        """
        one = motion.take(np.array([row]))
        speed = float(np.hypot(one.vx[0], one.vy[0]) + one.swing[0])
        stack = [(begin, float(one.end[0]))]
        while stack:
            a, b = stack.pop()
            middle, reach = (a + b) / 2, speed * (b - a) / 2
            if not self._touches(one, middle, self._target_m + reach):
                continue
            if reach <= 0.35 * self._tolerance_m:
                if float(one.gap_at(np.array([middle])).distance[0]) <= self._target_m + self._tolerance_m / 2 + reach:
                    return a
                continue
            stack += [(middle, b), (a, middle)]
        return float("inf")

    def _touches(self, one: Relative, t: float, grow_m: float) -> bool:
        self.calls += 1
        into = t - float(one.begin[0])
        a, b = one.half_a[:, 0], one.half_b[:, 0]
        _BOXES[0].side = np.array([2 * (a[0] + grow_m), 2 * (a[1] + grow_m), HEIGHT_M])
        _BOXES[1].side = np.array([2 * b[0], 2 * b[1], HEIGHT_M])
        _move(_OBJECTS[0], 0.0, 0.0, float(one.yaw_a[0] + one.turn_a[0] * into))
        x, y = float(one.dx[0] + one.vx[0] * into), float(one.dy[0] + one.vy[0] * into)
        _move(_OBJECTS[1], x, y, float(one.yaw_b[0] + one.turn_b[0] * into))
        return bool(fcl.collide(*_OBJECTS, fcl.CollisionRequest(), fcl.CollisionResult()))


def _move(moved: fcl.CollisionObject, x: float, y: float, yaw: float) -> None:
    moved.setTranslation(np.array([x, y, 0.0]))
    moved.setQuatRotation(np.array([cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)]))
