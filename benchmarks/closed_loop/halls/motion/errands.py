"""Errands between stations, drawn for each robot, and the ways that vendors plan for them."""

from collections.abc import Sequence

import numpy as np

from benchmarks.closed_loop.halls.ground.roadmap import Roadmap
from benchmarks.closed_loop.halls.motion.acts import Acts
from benchmarks.closed_loop.halls.motion.robots import TRAIL_NODES, Robot, way_of
from benchmarks.closed_loop.halls.motion.vendors import VENDORS

LEAST_ERRAND_M = 8.0


class Errands:
    def __init__(self, roadmap: Roadmap, seed: int, numbers: Sequence[int]) -> None:
        """`numbers` are those of the robots, by row."""
        self._roadmap, self._seed = roadmap, seed
        self.draws = [np.random.default_rng([seed, 5, k]) for k in numbers]
        count = len(roadmap.segments)
        self._costs = [np.random.default_rng([seed, 4, v]).uniform(1.0, 1.15, count) for v in range(len(VENDORS))]

    def first_nodes(self, vendor: int, start: int, goal: int) -> list[int]:
        return self._roadmap.route(start, goal, (), self._costs[vendor])

    def start(self, k: int) -> int:
        """Of robot k of all: bays first, then one station in each aisle."""
        by_segment: dict[int, int] = {}
        for node in self._roadmap.stations:
            by_segment.setdefault(min(edge.segment for edge in self._roadmap.edges[node].values()), node)
        starts = list(by_segment.values())
        return int(np.random.default_rng([self._seed, 9]).permutation(starts)[k])

    def new_goal(self, row: int, start: int, taken: set[int]) -> int:
        away_m = self._roadmap.distance_m[start]
        order = self.draws[row].permutation(self._roadmap.stations).tolist()
        order = [node for node in order if node != start]
        far = [node for node in order if away_m[node] >= LEAST_ERRAND_M]
        return next((node for nodes in (far, order) for node in nodes if node not in taken), far[0])

    def plan_next(self, robot: Robot, taken: set[int]) -> None:
        robot.next_goal = self.new_goal(robot.row, robot.goal, taken)
        robot.next_nodes = self.route_on(robot.way.nodes, robot.next_goal, VENDORS.index(robot.model.vendor))

    def route_on(self, nodes: list[int], goal: int, vendor: int) -> list[int]:
        """From the end of a way, without turning around in a lane."""
        here, before = nodes[-1], nodes[-2] if len(nodes) > 1 else -1
        is_bay = here in self._roadmap.bays
        found = self._roadmap.route(here, goal, () if is_bay else {(here, before)}, self._costs[vendor])
        return found or self._roadmap.route(here, goal, (), self._costs[vendor])

    def begin_next(self, robot: Robot, robots: Sequence[Robot], acts: Acts) -> None:
        mates = {g for r in robots if r.planner == robot.planner and r is not robot for g in (r.goal, r.next_goal)}
        nodes, goals = robot.way.nodes, {r.goal for r in robots if r.planner == robot.planner and r is not robot}
        robot.goal = robot.next_goal if robot.next_goal not in goals else self.new_goal(robot.row, nodes[-1], goals)
        route = self.route_on(nodes, robot.goal, VENDORS.index(robot.model.vendor))
        trail = nodes[-TRAIL_NODES:-1]
        gone_m = float(way_of(self._roadmap, nodes[-TRAIL_NODES:]).gone_m[-1])
        acts.take_way(robot, [*trail, *route], gone_m)
        robot.errand_m = robot.left_m(self._roadmap)
        self.plan_next(robot, mates | {robot.goal})
