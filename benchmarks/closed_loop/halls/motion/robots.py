"""One robot: its body, its way on the roadmap, and what it does at the moment."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, cos, hypot, inf, pi, sin
from typing import NamedTuple

import numpy as np

from benchmarks.closed_loop.halls.ground.roadmap import Roadmap
from benchmarks.planned_floors.logs.messages import Model
from ingest.batch import Floats

TRAIL_NODES = 10
"""Nodes that a robot has passed and may back out along."""


class Point(NamedTuple):
    """A point of a way off the roadmap."""

    x_m: float
    y_m: float
    backward: bool = False


@dataclass(slots=True)
class Hold:
    """Standing aside until others have passed."""

    request: str
    """Empty if it is the robot's own idea."""
    others: list[int]
    watched_m: Floats
    """(k, 2) where they must not be, nor be about to go."""
    latest_s: float


@dataclass(slots=True)
class Way:
    """A polyline over nodes of the roadmap."""

    nodes: list[int]
    points_m: Floats
    """(n, 2)"""
    gone_m: Floats
    """(n,) from its begin to each node."""
    yaw_rad: Floats
    """(n - 1,) of its legs."""
    corner_m: Floats
    """(n - 1,) where the straight of each leg ends."""

    def at(self, gone_m: float) -> tuple[float, float]:
        leg = self.leg(gone_m)
        on_m, yaw = gone_m - self.gone_m[leg], self.yaw_rad[leg]
        return float(self.points_m[leg, 0] + on_m * cos(yaw)), float(self.points_m[leg, 1] + on_m * sin(yaw))

    def leg(self, gone_m: float) -> int:
        """The leg at a distance from the begin; at a node the one that begins there."""
        return min(int(np.searchsorted(self.gone_m, gone_m + 1e-6, side="right")) - 1, len(self.yaw_rad) - 1)

    def near(self, x_m: float, y_m: float, low_m: float, high_m: float, within_m: float) -> float | None:
        """The first distance from the begin, of those between two, at which it is near a point."""
        for gone_m in np.arange(low_m, high_m + 0.1, 0.2):
            x, y = self.at(min(float(gone_m), high_m))
            if hypot(x - x_m, y - y_m) <= within_m:
                return float(min(gone_m, high_m))
        return None


def way_of(roadmap: Roadmap, nodes: Sequence[int]) -> Way:
    points_m = np.array([roadmap.xy[node] for node in nodes])
    steps_m = np.diff(points_m, axis=0)
    gone_m = np.concatenate([[0.0], np.hypot(*steps_m.T).cumsum()])
    yaw_rad = np.arctan2(steps_m[:, 1], steps_m[:, 0])
    corner_m = gone_m[1:].copy()
    for leg in range(len(yaw_rad) - 2, -1, -1):
        if abs(wrapped(float(yaw_rad[leg + 1] - yaw_rad[leg]))) < 1e-6:
            corner_m[leg] = corner_m[leg + 1]
    return Way(list(nodes), points_m, gone_m, yaw_rad, corner_m)


def wrapped(angle_rad: float) -> float:
    return (angle_rad + pi) % (2 * pi) - pi


@dataclass(slots=True)
class Robot:
    row: int
    model: Model
    planner: int
    """Robots of one planner know each other's plans."""
    patience_s: float
    x_m: float
    y_m: float
    way: Way
    goal: int
    """The station of its errand."""
    next_goal: int
    next_nodes: list[int]
    """The way of the errand after this one."""
    yaw: float = 0.0
    gone_m: float = 0.0
    """On its way."""
    speed_mps: float = 0.0
    detour: list[Point] = field(default_factory=list)
    rejoins_m: float = 0.0
    """Where it is on its way after the detour."""
    detour_for: str = ""
    """The request that the detour is made for."""
    hold: Hold | None = None
    """What it does now, or, with a detour or an aside, after it."""
    aside: int = -1
    """The node that it goes to, to let others pass; -1 for none."""
    waits: dict[str, tuple[tuple[float, float], Hold]] = field(default_factory=dict)
    """By request: the point of its way that it does not pass."""
    dwells_until_s: float = -inf
    stalls_until_s: float = -inf
    blocker: int = -1
    """The robot whose body is in its protective field."""
    hit_s: float = -inf
    """When something was in its protective field last."""
    stopped: bool = False
    """By its protective field."""
    blocked_since_s: float = inf
    tries_s: float = 0.0
    """When it may next do something about being blocked."""
    moved_s: float = 0.0
    """When it last moved or had a reason of its own to stand."""
    claimed: int = 0
    """The last node of its way that it may drive to."""
    held_nodes: dict[int, float] = field(default_factory=dict)
    """By node: where on its way it has left it."""
    held_segments: dict[int, float] = field(default_factory=dict)
    done_m: float = 0.0
    """Progress of errands before this one."""
    errand_m: float = 0.0
    """Length of this errand."""
    errands: int = 0

    @property
    def long_m(self) -> float:
        """Half of its length."""
        return self.model.length_m / 2

    @property
    def wide_m(self) -> float:
        return self.model.width_m / 2

    @property
    def leg(self) -> int:
        return self.way.leg(self.gone_m)

    @property
    def ended(self) -> bool:
        return self.gone_m >= self.way.gone_m[-1] - 1e-6

    def left_m(self, roadmap: Roadmap) -> float:
        """The least distance to the end of its errand."""
        node = min(self.leg + 1, len(self.way.nodes) - 1)
        x_m, y_m = self.way.points_m[node]
        return hypot(x_m - self.x_m, y_m - self.y_m) + float(roadmap.distance_m[self.way.nodes[node], self.goal])

    def progress_m(self, roadmap: Roadmap) -> float:
        return self.done_m + self.errand_m - self.left_m(roadmap)

    def off_rad(self) -> float:
        """From its heading to that of its way."""
        return wrapped(float(self.way.yaw_rad[self.leg]) - self.yaw)

    def towards(self, point: Point) -> float:
        """The heading in which it drives to a point."""
        yaw = atan2(point.y_m - self.y_m, point.x_m - self.x_m)
        return wrapped(yaw + pi) if point.backward else yaw
