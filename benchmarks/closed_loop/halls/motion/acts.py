"""What a robot can do for others, as its own vendor checks it: each returns why not, or an empty string."""

from collections.abc import Sequence
from itertools import product
from math import cos, hypot, sin

import numpy as np

from benchmarks.closed_loop.halls.ground.roadmap import Roadmap
from benchmarks.closed_loop.halls.motion.claims import BEFORE_M, Claims
from benchmarks.closed_loop.halls.motion.driving import Ground
from benchmarks.closed_loop.halls.motion.robots import TRAIL_NODES, Hold, Point, Robot, way_of
from deconflict_client.verbs import Side
from ingest.batch import Floats

ASIDE_M = {"left": (0.7, 0.6, 0.8), "right": (-0.7, -0.6, -0.8)}
"""To the left of its way."""
BACK_M, LEAD_M = (0.0, 0.5, 1.0), (0.7, 0.3)
REJOINS_M = 0.7
LEAST_BACK_M = 0.4
NEAR_PLACE_M = 1.2
BAY_WITHIN_M = 9.0
CLOSED_M = 0.6
XY = tuple[float, float]


class Acts:
    """Of the robots of one planner."""

    def __init__(self, roadmap: Roadmap, ground: Ground, claims: Claims) -> None:
        self._roadmap, self._ground, self._claims = roadmap, ground, claims

    def go_around(self, robot: Robot, other: int, side: Side | None = None) -> str:
        if abs(robot.off_rad()) > 0.05:
            return "turning"
        body = self._ground.bodies[other]
        c, s = cos(robot.yaw), sin(robot.yaw)
        dx_m, dy_m = body[0] - robot.x_m, body[1] - robot.y_m
        off = body[2] - robot.yaw
        along_m = dx_m * c + dy_m * s
        beyond_m = along_m + body[3] * abs(cos(off)) + body[4] * abs(sin(off)) + robot.long_m + 0.15
        aside_m = abs(dy_m * c - dx_m * s)
        if along_m < 0 or aside_m > robot.wide_m + body[3] or along_m > 6.0:
            return "not before it"
        rejoins_m = robot.gone_m + beyond_m + REJOINS_M
        if rejoins_m > robot.way.corner_m[robot.leg] + 1e-6:
            return "no room"
        asides_m = ASIDE_M[side] if side else [aside_m for sides_m in ASIDE_M.values() for aside_m in sides_m]
        for back_m, lead_m, left_m in product(BACK_M, LEAD_M, asides_m):
            points = [(-back_m, 0.0)] * (back_m > 0)
            points += [(lead_m - back_m, left_m), (beyond_m, left_m), (beyond_m + REJOINS_M, 0.0)]
            if points[-2][0] < points[-3][0]:
                continue
            detour = [Point(robot.x_m + a * c - b * s, robot.y_m + a * s + b * c, a < 0 and b == 0) for a, b in points]
            if self._ground.is_free(robot, detour, robot.yaw):
                return self._around(robot, detour, rejoins_m)
        return "no room"

    def _around(self, robot: Robot, detour: list[Point], rejoins_m: float) -> str:
        while self._claims.limit_m(robot) < min(rejoins_m, robot.way.gone_m[-1]) - 1e-6:
            if not self._claims.extend(robot):
                return "own robots"
        robot.detour, robot.rejoins_m = detour, rejoins_m
        return ""

    def back_out(self, robot: Robot, at: XY | None, hold: Hold) -> str:
        place_m = self._place_behind(robot) if at is None else self._trail_place(robot, at)
        if place_m is None or place_m > robot.gone_m - LEAST_BACK_M:
            return "no place"
        way = robot.way
        corners = [k for k in range(1, len(way.nodes) - 1) if place_m < way.gone_m[k] < robot.gone_m - 1e-6]
        turning = [k for k in corners if abs(way.yaw_rad[k] - way.yaw_rad[k - 1]) > 1e-6]
        detour = [Point(float(way.points_m[k, 0]), float(way.points_m[k, 1]), True) for k in turning[::-1]]
        detour.append(Point(*way.at(place_m), True))
        if not self._ground.is_free(robot, detour):
            return "not free behind"
        robot.detour, robot.rejoins_m, robot.hold = detour, place_m, hold
        hold.watched_m = np.array([way.at(float(m)) for m in np.arange(place_m, robot.gone_m + 1.0, 0.5)])
        return ""

    def give_up(self, robot: Robot) -> bool:
        """Leave a detour that is blocked: on from where it has backed out to, or straight to its way."""
        way, last = robot.way, robot.detour[-1]
        if last.backward:
            here_m = way.near(robot.x_m, robot.y_m, robot.rejoins_m, robot.gone_m, 0.15)
            robot.rejoins_m = robot.gone_m if here_m is None else here_m
        for gone_m, backward in ((robot.rejoins_m, False), (robot.gone_m, True), (robot.gone_m, False)):
            point = Point(*way.at(gone_m), backward)
            if (point.x_m - robot.x_m) ** 2 + (point.y_m - robot.y_m) ** 2 < 0.05 or self._ground.is_free(
                robot, [point]
            ):
                robot.detour, robot.rejoins_m, robot.hold = [point], gone_m, None
                return True
        return False

    def _place_behind(self, robot: Robot) -> float | None:
        """Before the last junction that it has passed."""
        junction, way = self._roadmap.junction, robot.way
        k = robot.leg
        while k > 0 and junction[way.nodes[k]] < 0:
            k -= 1
        while k > 0 and junction[way.nodes[k - 1]] >= 0 and self._is_inside(way.nodes[k - 1], way.nodes[k]):
            k -= 1
        place_m = float(way.gone_m[k]) - robot.long_m - BEFORE_M
        return max(place_m, 0.0) if k > 0 and place_m > -0.3 else None

    def _is_inside(self, a: int, b: int) -> bool:
        return any(self._roadmap.edges[p][q].segment < 0 for p, q in ((a, b), (b, a)) if q in self._roadmap.edges[p])

    def _trail_place(self, robot: Robot, at: XY) -> float | None:
        """The last place of its trail that is near `at`."""
        places = [float(m) for m in np.arange(0.0, robot.gone_m, 0.2)]
        away = [(hypot(x - at[0], y - at[1]), -m) for m in places for x, y in [robot.way.at(m)]]
        near = [each for each in away if each[0] <= NEAR_PLACE_M]
        return -min(near, key=lambda each: (round(each[0], 1), each[1]))[1] if near else None

    def step_aside(self, robot: Robot, at: XY | None, hold: Hold) -> str:
        """To a place behind it backward, to a bay forward."""
        if at is not None and self._trail_place(robot, at) is not None and not self.back_out(robot, at, hold):
            return ""
        for node in self._bays_near(robot, at):
            for nodes, gone_m in self._starts(robot, ()):
                more = self._roadmap.route(nodes[-1], node)
                if more and len(more) > 1 and self._drive_aside(robot, [*nodes, *more[1:]], gone_m, hold):
                    return ""
        return self.back_out(robot, at, hold) if at is None else "not free"

    def _bays_near(self, robot: Robot, at: XY | None) -> list[int]:
        x, y = (robot.x_m, robot.y_m) if at is None else at
        away = [(hypot(self._roadmap.xy[bay][0] - x, self._roadmap.xy[bay][1] - y), bay) for bay in self._roadmap.bays]
        near_m = BAY_WITHIN_M if at is None else 2.0
        return [bay for away_m, bay in sorted(away) if away_m <= near_m][:4]

    def _drive_aside(self, robot: Robot, nodes: list[int], gone_m: float, hold: Hold) -> bool:
        way = way_of(self._roadmap, nodes)
        first = way.leg(gone_m)
        if way.gone_m[-1] - gone_m > 20.0:
            return False
        points = [Point(x_m, y_m) for x_m, y_m in way.points_m[first + 1 :].tolist()]
        if not self._ground.is_free(robot, points):
            return False
        here = self._watched(robot)
        self.take_way(robot, nodes, gone_m)
        robot.aside, robot.hold, hold.watched_m = nodes[-1], hold, here
        return True

    def _watched(self, robot: Robot) -> Floats:
        last_m = float(robot.way.gone_m[-1])
        ahead_m = np.arange(robot.gone_m, min(robot.gone_m + 3.0, last_m) + 0.01, 0.5)
        return np.array([robot.way.at(float(m)) for m in ahead_m])

    def other_order(self, robot: Robot) -> str:
        """Another way than through the lane that others of its planner do not leave."""
        edge = self._claims.wanted(robot)
        if edge is None:
            return "no lane"
        a, b = robot.way.nodes[robot.leg], robot.way.nodes[robot.leg + 1]
        return self._take_best(robot, {edge, edge[::-1], (b, a)})

    def other_way(self, robot: Robot, at: XY) -> str:
        return self._take_best(robot, self._edges_near(at))

    def _take_best(self, robot: Robot, closed: set[tuple[int, int]]) -> str:
        best: tuple[float, list[int], float] | None = None
        for nodes, gone_m in self._starts(robot, closed):
            more = self._roadmap.route(nodes[-1], robot.goal, closed)
            if more and (len(more) > 1 or nodes[-1] == robot.goal):
                way = way_of(self._roadmap, [*nodes, *more[1:]])
                if best is None or way.gone_m[-1] - gone_m < best[0]:
                    best = (float(way.gone_m[-1]) - gone_m, way.nodes, gone_m)
        if best is None or best[1][-len(robot.way.nodes) :] == robot.way.nodes[-len(best[1]) :]:
            return "no other way"
        self.take_way(robot, best[1], best[2])
        return ""

    def _starts(self, robot: Robot, closed: set[tuple[int, int]] | tuple[()]) -> list[tuple[list[int], float]]:
        """Nodes that its way may begin with, and where on it the robot is: on along its leg, or back."""
        way, leg, roadmap = robot.way, robot.leg, self._roadmap
        a, b = way.nodes[leg], way.nodes[leg + 1]
        found = []
        trail = max(0, leg - TRAIL_NODES)
        if (a, b) not in closed:
            found.append((way.nodes[trail : leg + 2], robot.gone_m - float(way.gone_m[trail])))
        on_m = robot.gone_m - float(way.gone_m[leg])
        if on_m < 0.05 and leg > 0:
            found.append((way.nodes[trail : leg + 1], robot.gone_m - float(way.gone_m[trail])))
        elif a in roadmap.edges[b]:
            segment = roadmap.edges[b][a].segment
            if segment < 0 or not self._claims.others_in(segment, robot):
                found.append(([b, a], float(way.gone_m[leg + 1]) - robot.gone_m))
        return found

    def _edges_near(self, at: XY) -> set[tuple[int, int]]:
        found = set()
        for a, edges in enumerate(self._roadmap.edges):
            for b in edges:
                (x, y), (x2, y2) = self._roadmap.xy[a], self._roadmap.xy[b]
                length_m2 = (x2 - x) ** 2 + (y2 - y) ** 2
                share = min(1.0, max(0.0, ((at[0] - x) * (x2 - x) + (at[1] - y) * (y2 - y)) / length_m2))
                if hypot(x + share * (x2 - x) - at[0], y + share * (y2 - y) - at[1]) <= CLOSED_M:
                    found.add((a, b))
        return found

    def take_way(self, robot: Robot, nodes: Sequence[int], gone_m: float) -> None:
        """From now on its way is over these nodes, on which it is at `gone_m`."""
        robot.way, robot.gone_m, robot.speed_mps = way_of(self._roadmap, nodes), gone_m, 0.0
        robot.detour = []
        self._claims.anew(robot)
