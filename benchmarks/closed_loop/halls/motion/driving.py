"""How robots move in a tenth of a second: along their ways, with protective stops."""

from math import cos, hypot, inf, pi, sin, sqrt

import numpy as np

from benchmarks.closed_loop.halls.ground.bodies import NOTHING, first_hit
from benchmarks.closed_loop.halls.motion.claims import Claims
from benchmarks.closed_loop.halls.motion.robots import Point, Robot, wrapped
from benchmarks.planned_floors.truth.motion import STEP_S
from ingest.batch import Floats

GAINS_MPS2, BRAKES_MPS2, SLOWS_MPS2 = 0.8, 1.5, 0.8
TURNS_RADPS = 1.2
REVERSE_MPS, CREEP_MPS = 0.3, 0.4
MARGIN_M, CREEP_MARGIN_M = 0.45, 0.12
TURN_M, SWEEP_M = 0.02, 0.04
WARNED_MPS, WARNS_M, WARNS_BESIDE_M = 0.4, 0.6, 0.5
TURNS_WITHIN_M = 0.12
"""Beyond the point where a robot stops to turn, its protective field ends."""
FREE_S = 1.0
"""A protective field is free for so long before a robot starts again."""
NO_WALLS = np.zeros((0, 4))


class Ground:
    """Bodies and walls."""

    def __init__(self, walls: Floats, robots: int) -> None:
        self.walls = walls
        self.bodies = np.zeros((robots, 5))
        """x, y, yaw, half sizes."""

    def put(self, robot: Robot) -> None:
        self.bodies[robot.row] = robot.x_m, robot.y_m, robot.yaw, robot.long_m, robot.wide_m

    def hit(self, robot: Robot, x_m: float, y_m: float, yaw: float, more_m: float) -> int:
        """What its body, larger by `more_m` on all sides, would touch at a pose."""
        long, wide = robot.long_m + more_m, robot.wide_m + more_m
        return first_hit(self.bodies, self.walls, robot.row, x_m, y_m, yaw, long, wide)

    def ahead(self, robot: Robot, length_m: float, side: int, walls: bool, beside_m: float = 0.05) -> int:
        """What is in the field before (`side` 1) or behind (-1) its body."""
        out_m = side * (robot.long_m + length_m / 2)
        x_m, y_m = robot.x_m + out_m * cos(robot.yaw), robot.y_m + out_m * sin(robot.yaw)
        of = self.walls if walls else NO_WALLS
        more_m = SWEEP_M / 2 if walls else beside_m
        return first_hit(self.bodies, of, robot.row, x_m, y_m, robot.yaw, length_m / 2, robot.wide_m + more_m)

    def is_free(self, robot: Robot, points: list[Point], yaw_after: float | None = None) -> bool:
        """Whether its body has room on the way over points, turning on the spot at each."""
        x_m, y_m, yaw = robot.x_m, robot.y_m, robot.yaw
        for point in points:
            away_m = hypot(point.x_m - x_m, point.y_m - y_m)
            to = float(np.arctan2(point.y_m - y_m, point.x_m - x_m)) if away_m > 1e-6 else yaw
            to = wrapped(to + pi) if point.backward else to
            if not self._turns_free(robot, x_m, y_m, yaw, to):
                return False
            yaw = to
            for share in np.linspace(0, 1, max(2, int(away_m / 0.12) + 1))[1:]:
                if (
                    self.hit(robot, x_m + share * (point.x_m - x_m), y_m + share * (point.y_m - y_m), yaw, SWEEP_M)
                    != NOTHING
                ):
                    return False
            x_m, y_m = point.x_m, point.y_m
        return yaw_after is None or self._turns_free(robot, x_m, y_m, yaw, yaw_after)

    def _turns_free(self, robot: Robot, x_m: float, y_m: float, yaw: float, to: float) -> bool:
        off = wrapped(to - yaw)
        steps = int(abs(off) / 0.15) + 1
        return abs(off) < 1e-3 or all(
            self.hit(robot, x_m, y_m, yaw + off * k / steps, SWEEP_M) == NOTHING for k in range(1, steps + 1)
        )


class Driver:
    """Moves robots of one planner."""

    def __init__(self, ground: Ground, claims: Claims) -> None:
        self._ground, self._claims = ground, claims

    def stand(self, robot: Robot) -> None:
        robot.speed_mps = max(0.0, robot.speed_mps - BRAKES_MPS2 * STEP_S)

    def follow_way(self, robot: Robot, now_s: float, stalled: bool) -> None:
        if abs(robot.off_rad()) > 1e-3 and robot.speed_mps <= 0.0:
            self._turn(robot, robot.off_rad(), now_s, stalled)
            return
        stop_m = self._stop_m(robot)
        field_m = MARGIN_M + 0.65 * robot.speed_mps**2 / BRAKES_MPS2 + robot.speed_mps * STEP_S
        room_m = max(0.0, stop_m - robot.gone_m)
        field_m = min(field_m, float(robot.way.corner_m[robot.leg]) - robot.gone_m + TURNS_WITHIN_M)
        wants = not stalled and room_m > 1e-6
        if self._may_move(robot, field_m, 1, False, now_s, wants) and wants:
            allowed_mps = min(self._top_mps(robot, field_m), sqrt(2 * SLOWS_MPS2 * room_m) + 1e-3)
            slowed_mps = robot.speed_mps - BRAKES_MPS2 * STEP_S
            robot.speed_mps = max(min(allowed_mps, robot.speed_mps + GAINS_MPS2 * STEP_S), slowed_mps)
        else:
            self.stand(robot)
        step_m = min(robot.speed_mps * STEP_S, room_m)
        robot.gone_m += step_m
        if room_m - step_m < 0.01 and room_m > 0:
            robot.gone_m, robot.speed_mps = robot.gone_m + room_m - step_m, 0.0
        if step_m > 0:
            robot.x_m, robot.y_m = robot.way.at(robot.gone_m)
            robot.moved_s, robot.blocked_since_s = now_s, inf
        self._claims.release(robot, robot.gone_m)

    def _top_mps(self, robot: Robot, field_m: float) -> float:
        """Slower with a body in its warning field."""
        warned = self._ground.ahead(robot, field_m + WARNS_M, 1, False, WARNS_BESIDE_M) != NOTHING
        return WARNED_MPS if warned else robot.model.top_mps

    def _stop_m(self, robot: Robot) -> float:
        """Where on its way it must stand next."""
        corner_m = float(robot.way.corner_m[robot.leg])
        limit_m = self._claims.limit_m(robot)
        braking_m = robot.speed_mps**2 / (2 * SLOWS_MPS2) + 0.5
        tries = 0
        while (
            limit_m < min(corner_m, robot.gone_m + braking_m) + robot.long_m + 1.0
            and tries < 3
            and self._claims.extend(robot)
        ):
            limit_m = self._claims.limit_m(robot)
            tries += 1
        waits_m = min((self.wait_m(robot, point) for point, _ in robot.waits.values()), default=inf)
        return max(robot.gone_m, min(corner_m, limit_m, waits_m))

    def wait_m(self, robot: Robot, point: tuple[float, float]) -> float:
        """Where on its way a robot stands that does not pass a point; inf if the point is not on it."""
        end_m = min(robot.gone_m + 30.0, float(robot.way.gone_m[-1]))
        at_m = robot.way.near(*point, robot.gone_m, end_m, 1.0)
        return inf if at_m is None else max(robot.gone_m, at_m - robot.long_m)

    def _may_move(self, robot: Robot, field_m: float, side: int, walls: bool, now_s: float, wants: bool) -> bool:
        hit = self._ground.ahead(robot, field_m, side, walls)
        return self._note(robot, hit, now_s, wants)

    def _note(self, robot: Robot, hit: int, now_s: float, wants: bool) -> bool:
        """Whether it may move with this in its protective field."""
        if hit != NOTHING:
            robot.hit_s, robot.stopped = now_s, True
            robot.blocker = hit if wants else -1
            if wants and robot.speed_mps <= 0.0:
                robot.blocked_since_s = min(robot.blocked_since_s, now_s)
            return False
        if robot.stopped and robot.speed_mps <= 0.0 and now_s - robot.hit_s < FREE_S:
            return False
        robot.stopped, robot.blocker = False, -1
        return True

    def _turn(self, robot: Robot, off_rad: float, now_s: float, stalled: bool) -> None:
        ahead = max(-0.35, min(0.35, off_rad))
        hits = [self._ground.hit(robot, robot.x_m, robot.y_m, robot.yaw + part * ahead, TURN_M) for part in (0.4, 1.0)]
        hit = next((each for each in hits if each != NOTHING), NOTHING)
        if self._note(robot, hit, now_s, not stalled) and not stalled:
            most = TURNS_RADPS * STEP_S
            robot.yaw = wrapped(robot.yaw + max(-most, min(most, off_rad)))
            robot.moved_s, robot.blocked_since_s = now_s, inf

    def follow_detour(self, robot: Robot, now_s: float, stalled: bool) -> bool:
        """Off the roadmap. True when it has come to the end."""
        point = robot.detour[0]
        left_m = hypot(point.x_m - robot.x_m, point.y_m - robot.y_m)
        if left_m < 1e-3:
            robot.detour.pop(0)
            return not robot.detour
        off_rad = wrapped(robot.towards(point) - robot.yaw)
        if abs(off_rad) > 1e-3:
            robot.speed_mps = 0.0
            self._turn(robot, off_rad, now_s, stalled)
            return False
        field_m = min(CREEP_MARGIN_M, left_m + SWEEP_M / 2)
        if not self._may_move(robot, field_m, -1 if point.backward else 1, True, now_s, not stalled) or stalled:
            robot.speed_mps = 0.0
            return False
        robot.speed_mps = REVERSE_MPS if point.backward else CREEP_MPS
        share = min(1.0, robot.speed_mps * STEP_S / left_m)
        robot.x_m += share * (point.x_m - robot.x_m)
        robot.y_m += share * (point.y_m - robot.y_m)
        robot.moved_s, robot.blocked_since_s = now_s, inf
        return False
