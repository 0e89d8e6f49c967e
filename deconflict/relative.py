"""Pairs of segments, as the motion of one rectangle about another."""

from dataclasses import dataclass

import numpy as np

from deconflict.motion import Segments
from deconflict.rectangles import Apart, Gap, apart, gap
from ingest.seam import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Relative:
    """n pairs of segments over the time that they share. Arrays are (n,) unless said otherwise."""

    begin: Floats
    """Of the time shared, seconds into the slab."""
    end: Floats
    dx: Floats
    """B's centre from A's at `begin`."""
    dy: Floats
    vx: Floats
    vy: Floats
    yaw_a: Floats
    """At `begin`."""
    yaw_b: Floats
    turn_a: Floats
    turn_b: Floats
    half_a: Floats
    """(2, n) half sides."""
    half_b: Floats

    def __len__(self) -> int:
        return len(self.begin)

    def take(self, rows: Ints) -> "Relative":
        return Relative(*(getattr(self, name).take(rows, -1) for name in self.__slots__))

    def clipped(self, begin: Floats, end: Floats) -> "Relative":
        """The same motion over a shorter time."""
        begin, end = np.maximum(begin, self.begin), np.minimum(end, self.end)
        into = begin - self.begin
        return Relative(
            begin,
            end,
            self.dx + self.vx * into,
            self.dy + self.vy * into,
            self.vx,
            self.vy,
            self.yaw_a + self.turn_a * into,
            self.yaw_b + self.turn_b * into,
            self.turn_a,
            self.turn_b,
            self.half_a,
            self.half_b,
        )

    @property
    def swing(self) -> Floats:
        """The fastest that turning alone can close a gap, metres a second."""
        swing: Floats = np.abs(self.turn_a) * _radius(self.half_a) + np.abs(self.turn_b) * _radius(self.half_b)
        return swing

    @property
    def reach(self) -> Floats:
        """Sum of the circumscribed radii."""
        return _radius(self.half_a) + _radius(self.half_b)

    def gap_at(self, t: Floats) -> Gap:
        """The exact gap at `t`, seconds into the slab."""
        into = t - self.begin
        return gap(
            self.dx + self.vx * into,
            self.dy + self.vy * into,
            self.yaw_a + self.turn_a * into,
            self.yaw_b + self.turn_b * into,
            self.half_a,
            self.half_b,
        )

    def apart_at(self, t: Floats, target_m: float) -> Apart:
        """How far apart at `t`, and from there for how long beyond `target_m`, as far as the sides' axes tell."""
        into = t - self.begin
        return apart(
            self.dx + self.vx * into,
            self.dy + self.vy * into,
            self.vx,
            self.vy,
            self.yaw_a + self.turn_a * into,
            self.yaw_b + self.turn_b * into,
            self.half_a,
            self.half_b,
            self.swing,
            target_m,
        )

    def nearest_centres_after(self) -> Floats:
        """Seconds from `begin` until the centres are nearest to each other in the time shared."""
        speed_squared = self.vx * self.vx + self.vy * self.vy
        along = -(self.dx * self.vx + self.dy * self.vy)
        into = along / np.where(speed_squared > 0, speed_squared, 1.0)
        after: Floats = np.clip(into, 0.0, self.end - self.begin)
        return after

    def nearest_centres(self) -> Floats:
        """Smallest distance of the centres over the time shared."""
        into = self.nearest_centres_after()
        nearest: Floats = np.hypot(self.dx + self.vx * into, self.dy + self.vy * into)
        return nearest


def relative(segments: Segments, a: Ints, b: Ints, half: Floats) -> Relative:
    """Segments `a` against segments `b` of the same slab; `half` (2, robots) are half sides by robot.

    A's centre is subtracted before anything else, so nothing is lost far from the origin.
    """
    of_a, of_b = segments.take(a), segments.take(b)
    begin, end = np.maximum(of_a.t0, of_b.t0), np.minimum(of_a.t1, of_b.t1)
    into_a, into_b = begin - of_a.t0, begin - of_b.t0
    return Relative(
        begin,
        end,
        (of_b.x - of_a.x) + (of_b.vx * into_b - of_a.vx * into_a),
        (of_b.y - of_a.y) + (of_b.vy * into_b - of_a.vy * into_a),
        of_b.vx - of_a.vx,
        of_b.vy - of_a.vy,
        of_a.yaw + of_a.turn * into_a,
        of_b.yaw + of_b.turn * into_b,
        of_a.turn,
        of_b.turn,
        half.take(of_a.robot, 1),
        half.take(of_b.robot, 1),
    )


def _radius(half: Floats) -> Floats:
    """Of the circumscribed circle; `np.hypot` guards against overflow, at four times the cost."""
    radius: Floats = np.sqrt(half[0] * half[0] + half[1] * half[1])
    return radius
