"""Pairs of segments, as the motion of one rectangle about another."""

from dataclasses import dataclass

import numpy as np

from deconflict.motion import Bools, Segments
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

    def take(self, rows: Ints | Bools) -> "Relative":
        return Relative(*(getattr(self, name)[..., rows] for name in self.__slots__))

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
        radius_a, radius_b = np.hypot(*self.half_a), np.hypot(*self.half_b)
        swing: Floats = np.abs(self.turn_a) * radius_a + np.abs(self.turn_b) * radius_b
        return swing

    @property
    def reach(self) -> Floats:
        """Sum of the circumscribed radii."""
        reach: Floats = np.hypot(*self.half_a) + np.hypot(*self.half_b)
        return reach

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
    s = segments
    begin, end = np.maximum(s.t0[a], s.t0[b]), np.minimum(s.t1[a], s.t1[b])
    into_a, into_b = begin - s.t0[a], begin - s.t0[b]
    return Relative(
        begin,
        end,
        (s.x[b] - s.x[a]) + (s.vx[b] * into_b - s.vx[a] * into_a),
        (s.y[b] - s.y[a]) + (s.vy[b] * into_b - s.vy[a] * into_a),
        s.vx[b] - s.vx[a],
        s.vy[b] - s.vy[a],
        s.yaw[a] + s.turn[a] * into_a,
        s.yaw[b] + s.turn[b] * into_b,
        s.turn[a],
        s.turn[b],
        half[:, s.robot[a]],
        half[:, s.robot[b]],
    )
