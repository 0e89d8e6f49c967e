"""What is counted on a floor."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.closed_loop.halls.ground.bodies import WALL, first_hit, near_pairs
from benchmarks.closed_loop.halls.ground.roadmap import Roadmap
from benchmarks.closed_loop.halls.motion.driving import Ground
from benchmarks.closed_loop.halls.motion.robots import Robot
from benchmarks.planned_floors.truth.motion import STEP_S
from deconflict.adviser import Request
from ingest.batch import Floats

NEAR_M = 0.3
"""Bodies nearer than this have an encounter."""


@dataclass(frozen=True, slots=True)
class Figures:
    mps: float
    """Progress towards the ends of errands, by robot present."""
    errands_per_hour: float
    standoff_s: float
    """Robot seconds in rings of robots that stand for each other."""
    encounters_per_robot_hour: float
    wall_s: float
    body_s: float
    """Robot seconds in contact with walls and with bodies."""
    rescues: int
    requests_per_robot_hour: float
    verbs: dict[str, int]
    answers: dict[str, int]
    mps_by_vendor: dict[str, float]


@dataclass
class Scores:
    scored_s: float = 0.0
    standoff_s: float = 0.0
    wall_s: float = 0.0
    body_s: float = 0.0
    encounters: int = 0
    rescues: int = 0
    verbs: Counter[str] = field(default_factory=Counter)
    answers: Counter[str] = field(default_factory=Counter)
    _near: set[tuple[int, int]] = field(default_factory=set)
    _asked: set[tuple[object, ...]] = field(default_factory=set)
    _first_m: Floats = field(default_factory=lambda: np.zeros(0))
    _first_errands: int = 0

    def begin(self, robots: Sequence[Robot], roadmap: Roadmap) -> None:
        self._first_m = np.array([robot.progress_m(roadmap) for robot in robots])
        self._first_errands = sum(robot.errands for robot in robots)

    def asked(self, request: Request) -> None:
        key = (request.robot, request.verb, request.at, request.other)
        self.verbs[request.verb] += key not in self._asked
        self._asked.add(key)

    def step(self, robots: Sequence[Robot], ground: Ground) -> None:
        self.scored_s += STEP_S
        self.standoff_s += STEP_S * len(in_rings(robots))
        a, b = np.nonzero(near_pairs(ground.bodies, NEAR_M))
        near = set(zip(a.tolist(), b.tolist(), strict=True))
        self.encounters += len(near - self._near)
        self._near = near
        self.body_s += STEP_S * np.count_nonzero(near_pairs(ground.bodies, 0.0)) if near else 0.0
        for robot in robots:
            alone = ground.bodies[robot.row : robot.row + 1]
            body = robot.x_m, robot.y_m, robot.yaw, robot.long_m, robot.wide_m
            self.wall_s += STEP_S * (first_hit(alone, ground.walls, 0, *body) == WALL)

    def figures(self, robots: Sequence[Robot], roadmap: Roadmap, total_s: float) -> Figures:
        made_m = np.array([robot.progress_m(roadmap) for robot in robots]) - self._first_m
        mps = made_m / max(self.scored_s, STEP_S)
        vendors = np.array([robot.model.vendor for robot in robots])
        hours = len(robots) * max(self.scored_s, STEP_S) / 3600
        errands = sum(robot.errands for robot in robots) - self._first_errands
        return Figures(
            float(mps.mean()),
            errands / (max(self.scored_s, STEP_S) / 3600),
            self.standoff_s,
            self.encounters / hours,
            self.wall_s,
            self.body_s,
            self.rescues,
            sum(self.verbs.values()) / (len(robots) * total_s / 3600),
            dict(self.verbs),
            dict(self.answers),
            {str(vendor): float(mps[vendors == vendor].mean()) for vendor in np.unique(vendors)},
        )


def in_rings(robots: Sequence[Robot]) -> set[int]:
    """Rows of the robots that stand, each for the next and the last for the first."""
    wants = {r.row: r.blocker for r in robots if r.blocker >= 0 and r.speed_mps <= 0.0}
    found: set[int] = set()
    for row, first in wants.items():
        seen, at = [row], first
        while at in wants and at not in seen:
            seen.append(at)
            at = wants[at]
        if at == row:
            found.update(seen)
    return found
