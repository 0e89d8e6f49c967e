"""A hall whose robots hear an adviser and do what it asks, where they can."""

import heapq
import json
from collections.abc import Callable
from math import hypot, inf
from typing import Any

import numpy as np

from benchmarks.closed_loop.halls.ground.floors import Hall
from benchmarks.closed_loop.halls.motion.acts import Acts
from benchmarks.closed_loop.halls.motion.claims import Claims
from benchmarks.closed_loop.halls.motion.driving import Driver, Ground
from benchmarks.closed_loop.halls.motion.errands import Errands
from benchmarks.closed_loop.halls.motion.reports import DWELL_S, report
from benchmarks.closed_loop.halls.motion.requests import Requests
from benchmarks.closed_loop.halls.motion.robots import TRAIL_NODES, Hold, Robot, way_of
from benchmarks.closed_loop.halls.motion.vendors import (
    ALL_FOLLOW,
    HABITS,
    LENGTHS_M,
    TOPS_MPS,
    VENDORS,
    WIDTHS_M,
    Compliance,
)
from benchmarks.closed_loop.halls.scores import Figures, Scores, in_rings
from benchmarks.planned_floors.logs.messages import START_S, Model, identity, latency_s
from benchmarks.planned_floors.truth.motion import STEP_S
from deconflict.adviser import Request

SCORED_FROM_S = 180.0
STALLS_PER_S, STALL_S = 0.015, (2.0, 10.0)
RESCUED_AFTER_S, QUEUED_RESCUED_AFTER_S, RESCUE_S = 120.0, 240.0, 10.0
ORDER_PATIENCE_S = 10.0
"""A robot that waits for so long for those of its own planner looks for another way."""
RETRY_S, GIVES_UP_S = 5.0, 8.0
ASIDE_S = 15.0
"""How long a robot stands aside that has backed out on its own."""
PASSED_M, CLEAR_M, LOOKED_AHEAD_M = 1.2, 1.1, 15.0
IDENTITY_S = 60.0


class HallWorld:
    """One floor. Its time is `now_s`, seconds since the epoch.

    `only` is the one vendor whose robots are there, -1 for all. With `one_plan` all robots know each other's plans.
    """

    def __init__(
        self,
        hall: Hall,
        seed: int,
        habit: str,
        compliance: Compliance = ALL_FOLLOW,
        *,
        only: int = -1,
        one_plan: bool = False,
    ) -> None:
        self.hall, self._seed, self._habits, self._compliance = hall, seed, HABITS[habit], compliance
        self._roadmap = hall.roadmap()
        self._step = 0
        rows = [k for k in range(hall.robots) if only < 0 or k % 3 == only]
        self._ground = Ground(hall.walls(), len(rows))
        self._claims = [Claims(self._roadmap) for _ in VENDORS]
        self._drivers = [Driver(self._ground, claims) for claims in self._claims]
        self._acts = [Acts(self._roadmap, self._ground, claims) for claims in self._claims]
        self._stalls = np.random.default_rng([seed, 1])
        self._sending = np.random.default_rng([seed, 2])
        self._delays = np.random.default_rng([seed, 11])
        draws = np.random.default_rng([seed, 3]).random(hall.robots)
        self._errands = Errands(self._roadmap, seed, rows)
        self.robots = [self._robot(row, k, one_plan) for row, k in enumerate(rows)]
        self._obeys = [bool(draws[k] < compliance.share) and VENDORS[k % 3] != compliance.unwilling for k in rows]
        self._row = {robot.model.uuid: robot.row for robot in self.robots}
        self._requests = Requests(self.robots, self._acts, self._drivers)
        self._reports_s = [float(s) for s in np.random.default_rng([seed, 6]).uniform(0, 1, len(rows))]
        self._coming: list[tuple[float, int, Any]] = []
        self._asked: list[tuple[float, int, Request]] = []
        self._sent = 0
        self._answers: list[tuple[str, str, str]] = []
        self.scores = Scores()
        for robot in self.robots:
            self._ground.put(robot)
        self.scores.begin(self.robots, self._roadmap)

    @property
    def now_s(self) -> float:
        return START_S + self.time_s

    @property
    def time_s(self) -> float:
        """Since the begin of the floor."""
        return round(self._step * STEP_S, 1)

    def redraw(self, seed: int) -> None:
        """Draw later stalls anew."""
        self._stalls = np.random.default_rng([self._seed, 7, seed])

    def step(self) -> None:
        """A tenth of a second."""
        if self.time_s == SCORED_FROM_S:
            self.scores.begin(self.robots, self._roadmap)
        self._send_reports()
        while self._asked and self._asked[0][0] <= self.time_s:
            self._reach(heapq.heappop(self._asked)[2])
        draws, lasts_s = self._stalls.random(len(self.robots)), self._stalls.uniform(*STALL_S, len(self.robots))
        order = np.roll(np.arange(len(self.robots)), self._step % len(self.robots))
        for row in order.tolist():
            robot = self.robots[row]
            if draws[row] < STALLS_PER_S * STEP_S and robot.stalls_until_s <= self.time_s:
                robot.stalls_until_s = self.time_s + float(lasts_s[row])
            self._move(robot)
            self._ground.put(robot)
        self._step += 1
        if self._step % 10 == 0:
            self._rescue()
        if self.time_s > SCORED_FROM_S:
            self.scores.step(self.robots, self._ground)

    def heard(self) -> list[dict[str, Any]]:
        """Messages that have arrived since the last call."""
        found = []
        while self._coming and self._coming[0][0] <= self.time_s:
            found.append(heapq.heappop(self._coming)[2])
        return found

    def ask(self, request: Request) -> None:
        if not request.withdrawn:
            self.scores.asked(request)
        self._sent += 1
        delay_s = float(self._delays.uniform(*self._compliance.delay_s))
        heapq.heappush(self._asked, (self.time_s + delay_s, self._sent, request))

    def answers(self) -> list[tuple[str, str, str]]:
        found, self._answers = self._answers, []
        return found

    def figures(self) -> Figures:
        return self.scores.figures(self.robots, self._roadmap, self.time_s)

    # Errands

    def _robot(self, row: int, k: int, one_plan: bool) -> Robot:
        vendor, rng = k % 3, np.random.default_rng([self._seed, 8, k])
        length_m, width_m = (round(float(rng.uniform(*sizes[vendor])), 2) for sizes in (LENGTHS_M, WIDTHS_M))
        model = Model(f"{VENDORS[vendor]}-{k}-{self._seed}", VENDORS[vendor], length_m, width_m, TOPS_MPS[vendor])
        start = self._errands.start(k)
        planner = 0 if one_plan else vendor
        patience_s = self._habits[vendor].patience_s * float(rng.uniform(0.8, 1.2))
        goal = self._errands.new_goal(row, start, {start})
        nodes = self._errands.first_nodes(vendor, start, goal)
        x_m, y_m = self._roadmap.xy[start]
        way = way_of(self._roadmap, nodes)
        robot = Robot(row, model, planner, patience_s, x_m, y_m, way, goal, goal, nodes, yaw=float(way.yaw_rad[0]))
        robot.errand_m = robot.left_m(self._roadmap)
        self._errands.plan_next(robot, {start, goal})
        robot.dwells_until_s = float(rng.uniform(0.0, 8.0))
        self._claims[planner].anew(robot)
        return robot

    def _arrive(self, robot: Robot) -> None:
        robot.done_m += robot.errand_m - robot.left_m(self._roadmap)
        robot.errands += 1
        robot.dwells_until_s = self.time_s + float(self._errands.draws[robot.row].uniform(*DWELL_S))
        self._errands.begin_next(robot, self.robots, self._acts[robot.planner])

    # Motion

    def _move(self, robot: Robot) -> None:
        now_s, driver = self.time_s, self._drivers[robot.planner]
        stalled = robot.stalls_until_s > now_s
        self._end_waits(robot)
        if robot.dwells_until_s > now_s:
            driver.stand(robot)
            self._has_reason(robot)
        elif robot.detour:
            if driver.follow_detour(robot, now_s, stalled):
                self._end_detour(robot)
            elif now_s - robot.moved_s >= GIVES_UP_S and not stalled and now_s >= robot.tries_s:
                self._give_up(robot)
        elif robot.hold is not None and robot.aside < 0:
            self._has_reason(robot)
            if self._is_over(robot.hold):
                self._end_hold(robot)
        elif robot.ended:
            self._at_end(robot)
        else:
            driver.follow_way(robot, now_s, stalled)
            patience_s = ORDER_PATIENCE_S + robot.row % 7
            if robot.blocker < 0 and not stalled and now_s - robot.moved_s >= patience_s and now_s >= robot.tries_s:
                robot.tries_s = now_s + RETRY_S
                self._acts[robot.planner].other_order(robot)
        if robot.blocker >= 0 and now_s - robot.blocked_since_s >= robot.patience_s and now_s >= robot.tries_s:
            self._lose_patience(robot)

    def _has_reason(self, robot: Robot) -> None:
        robot.moved_s, robot.blocked_since_s, robot.blocker = self.time_s, inf, -1

    def _end_detour(self, robot: Robot) -> None:
        robot.gone_m, robot.speed_mps, robot.detour = robot.rejoins_m, 0.0, []
        robot.x_m, robot.y_m = robot.way.at(robot.gone_m)
        self._claims[robot.planner].anew(robot)
        if robot.hold is None and robot.detour_for:
            self._answers.append((robot.detour_for, "done", ""))
        elif robot.hold is not None and not robot.hold.request:
            robot.hold.latest_s = self.time_s + ASIDE_S
        robot.detour_for = ""

    def _give_up(self, robot: Robot) -> None:
        """A detour is blocked for so long that the robot leaves it."""
        robot.tries_s = self.time_s + RETRY_S
        name = robot.hold.request if robot.hold is not None else robot.detour_for
        if self._acts[robot.planner].give_up(robot):
            robot.detour_for = ""
            if name:
                self._answers.append((name, "declined", "blocked"))
                self.scores.answers["declined: blocked"] += 1

    def _at_end(self, robot: Robot) -> None:
        if robot.aside >= 0:
            robot.aside = -1
            return
        self._arrive(robot)

    def _end_hold(self, robot: Robot) -> None:
        hold, robot.hold, robot.aside = robot.hold, None, -1
        if hold is not None and hold.request:
            self._answers.append((hold.request, "done", ""))
        if robot.ended and robot.way.nodes[-1] != robot.goal:
            nodes = robot.way.nodes
            route = self._errands.route_on(nodes, robot.goal, VENDORS.index(robot.model.vendor))
            gone_m = float(way_of(self._roadmap, nodes[-TRAIL_NODES:]).gone_m[-1])
            self._acts[robot.planner].take_way(robot, [*nodes[-TRAIL_NODES:-1], *route], gone_m)

    def _is_over(self, hold: Hold) -> bool:
        if self.time_s >= hold.latest_s:
            return True
        return bool(hold.others) and all(self._has_passed(self.robots[other], hold) for other in hold.others)

    def _has_passed(self, other: Robot, hold: Hold) -> bool:
        """Whether a robot is not where it was waited for, and is not about to go there."""
        watched_m = hold.watched_m
        if np.hypot(watched_m[:, 0] - other.x_m, watched_m[:, 1] - other.y_m).min() < PASSED_M + other.long_m:
            return False
        end_m = min(other.gone_m + LOOKED_AHEAD_M, float(other.way.gone_m[-1]))
        for gone_m in np.arange(other.gone_m, end_m, 0.7):
            x_m, y_m = other.way.at(float(gone_m))
            if np.hypot(watched_m[:, 0] - x_m, watched_m[:, 1] - y_m).min() < CLEAR_M:
                return False
        return True

    def _end_waits(self, robot: Robot) -> None:
        for name, (_, hold) in list(robot.waits.items()):
            self._has_reason(robot)
            if self._is_over(hold):
                del robot.waits[name]
                self._answers.append((name, "done", ""))

    def _lose_patience(self, robot: Robot) -> None:
        blocker = self.robots[robot.blocker]
        robot.tries_s = self.time_s + RETRY_S
        if blocker.planner == robot.planner or robot.hold is not None or robot.detour or robot.ended:
            return
        acts = self._acts[robot.planner]
        tries: dict[str, Callable[[], str]] = {
            "go_around": lambda: acts.go_around(robot, blocker.row),
            "back_out": lambda: acts.back_out(robot, None, Hold("", [], np.zeros((0, 2)), inf)),
            "other_way": lambda: acts.other_way(robot, (blocker.x_m, blocker.y_m)),
        }
        for name in self._habits[VENDORS.index(robot.model.vendor)].tries:
            if not tries[name]():
                return

    def _rescue(self) -> None:
        """A person takes away what has stood for too long."""
        rings = in_rings(self.robots)
        for robot in self.robots:
            stood_s = self.time_s - robot.moved_s
            is_blocked = robot.row in rings or (
                robot.blocker >= 0 and self.robots[robot.blocker].planner != robot.planner
            )
            if stood_s > (RESCUED_AFTER_S if is_blocked else QUEUED_RESCUED_AFTER_S):
                free = self._free_station(robot)
                if free is not None:
                    self._carry(robot, free)
                    return

    def _free_station(self, robot: Robot) -> int | None:
        taken = {r.goal for r in self.robots if r is not robot}
        for node in self._errands.draws[robot.row].permutation(self._roadmap.bays).tolist():
            x_m, y_m = self._roadmap.xy[node]
            if node not in taken and all(hypot(r.x_m - x_m, r.y_m - y_m) > 2.5 for r in self.robots):
                return int(node)
        return None

    def _carry(self, robot: Robot, node: int) -> None:
        self.scores.rescues += 1
        robot.done_m = robot.progress_m(self._roadmap)
        (before,) = [k for k, edges in enumerate(self._roadmap.edges) if node in edges]
        robot.detour, robot.hold, robot.aside, robot.waits = [], None, -1, {}
        robot.way = way_of(self._roadmap, [before, node])
        robot.gone_m, robot.goal = float(robot.way.gone_m[-1]), node
        (robot.x_m, robot.y_m), robot.yaw = self._roadmap.xy[node], float(robot.way.yaw_rad[-1])
        robot.dwells_until_s = self.time_s + RESCUE_S
        self._errands.begin_next(robot, self.robots, self._acts[robot.planner])
        self._has_reason(robot)
        self._ground.put(robot)

    # Messages

    def _send_reports(self) -> None:
        for robot in self.robots:
            if self._step % round(IDENTITY_S / STEP_S) == 0:
                message = json.loads(identity(robot.model).message)
                self._send(message)
            if self._reports_s[robot.row] <= self.time_s:
                self._reports_s[robot.row] += float(self._sending.uniform(0.9, 1.1))
                self._send(report(robot, self._drivers[robot.planner], self._roadmap, self.time_s))

    def _send(self, message: dict[str, Any]) -> None:
        self._sent += 1
        is_first = "manufacturerName" in message and self._step == 0
        late_s = 0.0 if is_first else latency_s(self._sending)
        heapq.heappush(self._coming, (self.time_s + late_s, self._sent, message))

    # Requests

    def _reach(self, request: Request) -> None:
        """A request reaches its robot."""
        robot = self.robots[self._row[request.robot]]
        if request.withdrawn:
            self._requests.withdraw(robot, request.id, self.time_s)
            return
        if not self._obeys[robot.row]:
            if self._compliance.declines:
                self._answer(request, "busy")
            return
        self._answer(request, self._requests.do(robot, request, self.time_s))

    def _answer(self, request: Request, why: str) -> None:
        answer = "declined" if why else "accepted"
        self._answers.append((request.id, answer, why))
        self.scores.answers[f"{request.verb} {answer}{why and ': '}{why}"] += 1
