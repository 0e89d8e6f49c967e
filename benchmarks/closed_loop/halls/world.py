"""A hall whose robots hear an adviser and do what it asks, where they can."""

import heapq
import json
from collections.abc import Callable
from dataclasses import dataclass
from math import hypot, inf
from typing import Any

import numpy as np

from benchmarks.closed_loop.halls.acts import Acts
from benchmarks.closed_loop.halls.claims import Claims
from benchmarks.closed_loop.halls.driving import Driver, Ground
from benchmarks.closed_loop.halls.floors import Hall
from benchmarks.closed_loop.halls.reports import DWELL_S, report
from benchmarks.closed_loop.halls.robots import TRAIL_NODES, Hold, Robot, way_of
from benchmarks.closed_loop.halls.scores import Figures, Scores, in_rings
from benchmarks.planned_floors.logs.messages import START_S, Model, identity, latency_s
from benchmarks.planned_floors.truth.motion import STEP_S
from deconflict.adviser import Request

SCORED_FROM_S = 180.0
STALLS_PER_S, STALL_S = 0.015, (2.0, 10.0)
RESCUED_AFTER_S, QUEUED_RESCUED_AFTER_S, RESCUE_S = 120.0, 240.0, 10.0
ORDER_PATIENCE_S = 10.0
"""A robot that waits for so long for those of its own planner looks for another way."""
RETRY_S, PAUSE_S, GIVES_UP_S = 5.0, 2.0, 8.0
ASIDE_S = 15.0
"""How long a robot stands aside that has backed out on its own."""
PASSED_M, CLEAR_M, LOOKED_AHEAD_M = 1.2, 1.1, 15.0
IDENTITY_S = 60.0
LEAST_ERRAND_M = 8.0
VENDORS = ("Amber", "Birch", "Cedar")
LENGTHS_M, WIDTHS_M, TOPS_MPS = ((0.7, 0.8), (0.95, 1.05), (1.2, 1.3)), ((0.5, 0.55), (0.6, 0.7), (0.7, 0.75)), (1.4, 1.2, 1.0)


@dataclass(frozen=True, slots=True)
class Habit:
    """What a vendor's robot does when a body of another vendor has blocked it for a while."""

    patience_s: float
    tries: tuple[str, ...] = ()


PATIENT = Habit(inf)
HABITS: dict[str, tuple[Habit, Habit, Habit]] = {
    "replan_5s": (Habit(5.0, ("other_way",)),) * 3,
    "wait_15s": (Habit(15.0, ("go_around", "back_out")),) * 3,
    "around_15s": (Habit(15.0, ("go_around",)),) * 3,
    "for_ever": (PATIENT,) * 3,
    "mixed": (Habit(5.0, ("other_way",)), Habit(15.0, ("go_around", "back_out")), PATIENT),
}


@dataclass(frozen=True, slots=True)
class Compliance:
    """How requests reach robots, and which robots follow them."""

    share: float = 1.0
    """Of the robots, drawn."""
    delay_s: tuple[float, float] = (0.3, 0.3)
    """Least and greatest."""
    unwilling: str = ""
    """A vendor whose robots never follow."""
    declines: bool = False
    """Whether robots that do not follow say so."""


class HallWorld:
    """One floor. Its time is `now_s`, seconds since the epoch.

    `only` is the one vendor whose robots are there, -1 for all. With `one_plan` all robots know each other's plans.
    """

    def __init__(
        self, hall: Hall, seed: int, habit: str, compliance: Compliance = Compliance(), *, only: int = -1, one_plan: bool = False
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
        draws = np.random.default_rng([seed, 3]).random(hall.robots)
        self._costs = [np.random.default_rng([seed, 4, v]).uniform(1.0, 1.15, len(self._roadmap.segments)) for v in range(3)]
        self._errands = [np.random.default_rng([seed, 5, k]) for k in rows]
        self.robots = [self._robot(row, k, one_plan) for row, k in enumerate(rows)]
        self._obeys = [bool(draws[k] < compliance.share) and VENDORS[k % 3] != compliance.unwilling for k in rows]
        self._row = {robot.model.uuid: robot.row for robot in self.robots}
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
        delay_s = float(self._sending.uniform(*self._compliance.delay_s))
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
        start = self._start(k)
        planner = 0 if one_plan else vendor
        patience_s = self._habits[vendor].patience_s * float(rng.uniform(0.8, 1.2))
        goal = self._new_goal(row, start, {start})
        nodes = self._roadmap.route(start, goal, (), self._costs[vendor])
        x_m, y_m = self._roadmap.xy[start]
        way = way_of(self._roadmap, nodes)
        robot = Robot(row, model, planner, patience_s, x_m, y_m, way, goal, goal, nodes, yaw=float(way.yaw_rad[0]))
        robot.errand_m = robot.left_m(self._roadmap)
        self._plan_next(robot, {start, goal})
        robot.dwells_until_s = float(rng.uniform(0.0, 8.0))
        self._claims[planner].anew(robot)
        return robot

    def _start(self, k: int) -> int:
        """Of robot k of all: bays first, then one station in each aisle."""
        by_segment: dict[int, int] = {}
        for node in self._roadmap.stations:
            by_segment.setdefault(min(edge.segment for edge in self._roadmap.edges[node].values()), node)
        starts = list(by_segment.values())
        return int(np.random.default_rng([self._seed, 9]).permutation(starts)[k])

    def _new_goal(self, row: int, start: int, taken: set[int]) -> int:
        away_m = self._roadmap.distance_m[start]
        order = self._errands[row].permutation(self._roadmap.stations).tolist()
        order = [node for node in order if node != start]
        far = [node for node in order if away_m[node] >= LEAST_ERRAND_M]
        return next((node for nodes in (far, order) for node in nodes if node not in taken), far[0])

    def _plan_next(self, robot: Robot, taken: set[int]) -> None:
        robot.next_goal = self._new_goal(robot.row, robot.goal, taken)
        robot.next_nodes = self._route_on(robot.way.nodes, robot.next_goal, VENDORS.index(robot.model.vendor))

    def _route_on(self, nodes: list[int], goal: int, vendor: int) -> list[int]:
        """From the end of a way, without turning around in a lane."""
        here, before = nodes[-1], nodes[-2] if len(nodes) > 1 else -1
        is_bay = here in self._roadmap.bays
        found = self._roadmap.route(here, goal, () if is_bay else {(here, before)}, self._costs[vendor])
        return found or self._roadmap.route(here, goal, (), self._costs[vendor])

    def _arrive(self, robot: Robot) -> None:
        robot.done_m += robot.errand_m - robot.left_m(self._roadmap)
        robot.errands += 1
        robot.dwells_until_s = self.time_s + float(self._errands[robot.row].uniform(*DWELL_S))
        self._begin_next(robot)

    def _begin_next(self, robot: Robot) -> None:
        mates = {g for r in self.robots if r.planner == robot.planner and r is not robot for g in (r.goal, r.next_goal)}
        nodes, goals = robot.way.nodes, {r.goal for r in self.robots if r.planner == robot.planner and r is not robot}
        robot.goal = robot.next_goal if robot.next_goal not in goals else self._new_goal(robot.row, nodes[-1], goals)
        route = self._route_on(nodes, robot.goal, VENDORS.index(robot.model.vendor))
        trail = nodes[-TRAIL_NODES:-1]
        gone_m = float(way_of(self._roadmap, nodes[-TRAIL_NODES:]).gone_m[-1])
        self._acts[robot.planner].take_way(robot, [*trail, *route], gone_m)
        robot.errand_m = robot.left_m(self._roadmap)
        self._plan_next(robot, mates | {robot.goal})

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
            if self._is_over(robot, robot.hold):
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
            route = self._route_on(nodes, robot.goal, VENDORS.index(robot.model.vendor))
            gone_m = float(way_of(self._roadmap, nodes[-TRAIL_NODES:]).gone_m[-1])
            self._acts[robot.planner].take_way(robot, [*nodes[-TRAIL_NODES:-1], *route], gone_m)

    def _is_over(self, robot: Robot, hold: Hold) -> bool:
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
            if self._is_over(robot, hold):
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
            is_blocked = robot.row in rings or (robot.blocker >= 0 and self.robots[robot.blocker].planner != robot.planner)
            if stood_s > (RESCUED_AFTER_S if is_blocked else QUEUED_RESCUED_AFTER_S):
                free = self._free_station(robot)
                if free is not None:
                    self._carry(robot, free)
                    return

    def _free_station(self, robot: Robot) -> int | None:
        taken = {r.goal for r in self.robots if r is not robot}
        for node in self._errands[robot.row].permutation(self._roadmap.bays).tolist():
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
        self._begin_next(robot)
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
            self._withdraw(robot, request.id)
            return
        if not self._obeys[robot.row]:
            if self._compliance.declines:
                self._answer(request, "busy")
            return
        self._answer(request, self._do(robot, request))

    def _answer(self, request: Request, why: str) -> None:
        answer = "declined" if why else "accepted"
        self._answers.append((request.id, answer, why))
        self.scores.answers[f"{request.verb} {answer}{why and ': '}{why}"] += 1

    def _withdraw(self, robot: Robot, name: str) -> None:
        robot.waits.pop(name, None)
        if robot.hold is not None and robot.hold.request == name:
            robot.hold.latest_s = self.time_s

    def _do(self, robot: Robot, request: Request) -> str:
        acts = self._acts[robot.planner]
        others = [self._row[uuid] for uuid in request.until or (request.other,) if uuid in self._row]
        hold = Hold(request.id, others, np.zeros((0, 2)), request.latest_s - START_S)
        if request.verb == "go_first":
            robot.waits, robot.hit_s, robot.tries_s = {}, -inf, self.time_s + PAUSE_S
            return ""
        if request.verb == "wait_before":
            return self._wait_before(robot, request, hold)
        if robot.detour or robot.hold is not None or robot.ended:
            return "busy"
        if robot.dwells_until_s > self.time_s or robot.stalls_until_s > self.time_s or robot.speed_mps > 0.05:
            return "busy"
        if request.verb == "go_around":
            why = acts.go_around(robot, others[0]) if others else "past whom"
            robot.detour_for = robot.detour_for if why else request.id
            return why
        if request.verb == "other_way":
            return self._other_way(robot, request)
        return (acts.step_aside if request.verb == "step_aside" else acts.back_out)(robot, request.at, hold)

    def _other_way(self, robot: Robot, request: Request) -> str:
        at = request.at
        if at is None and request.other in self._row:
            other = self.robots[self._row[request.other]]
            at = other.x_m, other.y_m
        return "no place" if at is None else self._acts[robot.planner].other_way(robot, at)

    def _wait_before(self, robot: Robot, request: Request, hold: Hold) -> str:
        if request.at is None:
            return "no place"
        wait_m = self._drivers[robot.planner].wait_m(robot, request.at)
        if wait_m == inf:
            return "not on its way"
        if robot.gone_m + robot.speed_mps**2 / 1.6 > wait_m + 0.05:
            return "too late"
        hold.watched_m = np.array([request.at])
        robot.waits[request.id] = (request.at, hold)
        return ""
