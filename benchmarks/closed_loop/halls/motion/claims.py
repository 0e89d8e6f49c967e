"""Order within one vendor: its robots claim junctions and lanes before they drive into them."""

from collections import defaultdict
from math import hypot
from typing import NamedTuple

from benchmarks.closed_loop.halls.ground.roadmap import Roadmap
from benchmarks.closed_loop.halls.motion.robots import Robot

BEFORE_M = 0.9
"""From the front of a robot to the junction before which it waits."""
BEYOND_M = 0.4
"""From the rear of a robot to the node that it leaves to others."""


class Block(NamedTuple):
    """A junction and the lane behind it, as far as a way leads through them."""

    nodes: list[int]
    """Indices in the way, of the nodes in the junction."""
    segment: int
    """-1 for none."""
    sign: int
    last: int
    """Index in the way of the last node in the lane."""


class Claims:
    """What the robots of one planner hold."""

    def __init__(self, roadmap: Roadmap) -> None:
        self._roadmap = roadmap
        self._nodes: dict[int, set[int]] = defaultdict(set)
        self._segments: dict[int, dict[int, int]] = defaultdict(dict)
        """By segment and robot: its direction."""
        self._last: dict[int, tuple[int, Robot]] = {}
        """By robot: the segment that it claimed last."""

    def others_in(self, segment: int, robot: Robot) -> bool:
        return bool(self._segments[segment].keys() - {robot.row})

    def limit_m(self, robot: Robot) -> float:
        """How far on its way a robot may drive."""
        way = robot.way
        if robot.claimed >= len(way.nodes) - 1:
            return float(way.gone_m[-1])
        return max(robot.gone_m, float(way.gone_m[robot.claimed + 1]) - robot.long_m - BEFORE_M)

    def extend(self, robot: Robot) -> bool:
        """Claim the next junction and the lane behind it. False if others hold them."""
        if robot.claimed >= len(robot.way.nodes) - 1:
            return False
        if self._is_behind(robot):
            return False
        block = self._block(robot, robot.claimed + 1)
        if any(self._nodes[robot.way.nodes[k]] - {robot.row} for k in block.nodes) or not self._has_room(robot, block):
            return False
        self._take(robot, block)
        return True

    def wanted(self, robot: Robot) -> tuple[int, int] | None:
        """The first edge of the lane that it would claim next, if it stands for that."""
        nodes = robot.way.nodes
        if robot.claimed >= len(nodes) - 1 or self.limit_m(robot) > robot.gone_m + 0.3 or self._is_behind(robot):
            return None
        block = self._block(robot, robot.claimed + 1)
        first = block.nodes[-1] if block.nodes else robot.claimed
        return (nodes[first], nodes[first + 1]) if first + 1 < len(nodes) else None

    def _is_behind(self, robot: Robot) -> bool:
        """Whether another is before it in the last lane that both have claimed."""
        segment, end = self._last[robot.row][0], self._roadmap.xy[robot.way.nodes[robot.claimed + 1]]
        others = [self._last[row] for row in self._segments[segment] if row != robot.row] if segment >= 0 else []
        away_m = hypot(robot.x_m - end[0], robot.y_m - end[1])
        return any(last == segment and hypot(r.x_m - end[0], r.y_m - end[1]) < away_m for last, r in others)

    def _has_room(self, robot: Robot, block: Block) -> bool:
        if block.segment < 0:
            return True
        segment = self._roadmap.segments[block.segment]
        signs = [sign for row, sign in self._segments[block.segment].items() if row != robot.row]
        return len(signs) < segment.room and not (segment.narrow and any(sign != block.sign for sign in signs))

    def _block(self, robot: Robot, first: int) -> Block:
        nodes, roadmap = robot.way.nodes, self._roadmap
        last, inside = first, [first] if roadmap.junction[nodes[first]] >= 0 else []
        while last + 1 < len(nodes) and roadmap.edges[nodes[last]][nodes[last + 1]].segment < 0:
            last += 1
            inside.append(last)
        if last + 1 == len(nodes):
            return Block(inside, -1, 0, last)
        edge = roadmap.edges[nodes[last]][nodes[last + 1]]
        while last + 1 < len(nodes) and roadmap.edges[nodes[last]][nodes[last + 1]].segment == edge.segment:
            last += 1
            if roadmap.junction[nodes[last]] >= 0:
                return Block(inside, edge.segment, edge.sign, last - 1)
        return Block(inside, edge.segment, edge.sign, last)

    def _take(self, robot: Robot, block: Block) -> None:
        way, beyond_m = robot.way, robot.long_m + BEYOND_M
        for k in block.nodes:
            self._nodes[way.nodes[k]].add(robot.row)
            robot.held_nodes[way.nodes[k]] = float(way.gone_m[k]) + beyond_m
        if block.segment >= 0:
            self._segments[block.segment][robot.row] = block.sign
            ends = block.last + 1
            robot.held_segments[block.segment] = float(way.gone_m[ends]) + beyond_m if ends < len(way.nodes) else 1e9
        robot.claimed = max(robot.claimed, block.last)
        self._last[robot.row] = block.segment, robot

    def release(self, robot: Robot, gone_m: float) -> None:
        """What lies behind a distance on its way."""
        for node in [node for node, until_m in robot.held_nodes.items() if gone_m > until_m]:
            del robot.held_nodes[node]
            self._nodes[node].discard(robot.row)
        for segment in [segment for segment, until_m in robot.held_segments.items() if gone_m > until_m]:
            del robot.held_segments[segment]
            self._segments[segment].pop(robot.row, None)

    def anew(self, robot: Robot) -> None:
        """Hold what a robot that has another way, or was moved, stands on, whoever holds it too."""
        self.release(robot, 1e12)
        leg, nodes = robot.leg, robot.way.nodes
        first = leg
        while first > 0 and (
            robot.gone_m - robot.way.gone_m[first] < robot.long_m + BEYOND_M
            or self._roadmap.edges[nodes[first]].get(nodes[first + 1], None) is None
            or self._roadmap.edges[nodes[first]][nodes[first + 1]].segment < 0
        ):
            if self._roadmap.junction[nodes[first]] < 0:
                break
            first -= 1
        robot.claimed = first
        while robot.claimed <= leg and robot.claimed < len(nodes) - 1:
            before = robot.claimed
            self._take(robot, self._block(robot, first if robot.claimed == first else robot.claimed + 1))
            if robot.claimed == before:
                break
        self.release(robot, robot.gone_m)
