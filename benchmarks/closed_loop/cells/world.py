"""A floor of cells whose robots hear an adviser and do what it asks."""

import copy
import json
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from benchmarks.planned_floors.floors.driving.driving import NO_WAIT
from benchmarks.planned_floors.floors.driving.grid import CELL_M
from benchmarks.planned_floors.floors.grid_floor import due_reports, models_of, reports
from benchmarks.planned_floors.floors.habits import GridFloor
from benchmarks.planned_floors.floors.protection.scene import HALF_M, Scene
from benchmarks.planned_floors.floors.traffic import Traffic
from benchmarks.planned_floors.logs.messages import START_S, identity
from benchmarks.planned_floors.truth.motion import STEP_S
from deconflict.adviser import Request
from ingest.batch import Floats

Sent = TypeVar("Sent")
SCORED_FROM_S = 120.0
LOOKED_AHEAD = 60
"""Visits in which the cell of a request is looked for."""
NEAR_M = 0.3
"""Bodies nearer than this have an encounter."""


@dataclass(frozen=True, slots=True)
class Compliance:
    """How requests reach robots, and which robots follow them."""

    share: float = 1.0
    """Of the robots, drawn."""
    delay_s: float = 0.3
    unwilling: str = ""
    """A vendor whose robots never follow."""
    declines: bool = False
    """Whether robots that do not follow say so."""


class Figures(NamedTuple):
    mps: float
    cells_per_min: float
    requests_per_robot_hour: float
    encounters_per_robot_hour: float
    mps_by_vendor: dict[str, float]
    verbs: dict[str, int]


class CellWorld:
    """One floor. Its time is `now_s`, seconds since the epoch."""

    def __init__(self, made_of: GridFloor, compliance: Compliance = Compliance()) -> None:
        self._compliance = compliance
        self.traffic = Traffic(made_of)
        self.models = models_of(made_of)
        self._row = {model.uuid: row for row, model in enumerate(self.models)}
        self._rng = np.random.default_rng([made_of.seed, 9])
        self._due = due_reports(self.traffic, round(made_of.seconds / STEP_S) + 1, self._rng)
        obeys = np.random.default_rng([made_of.seed, 10]).random(len(self.models)) < compliance.share
        self._obeys = [bool(o) and m.vendor != compliance.unwilling for o, m in zip(obeys, self.models, strict=True)]
        self._messages: list[tuple[float, dict[str, Any]]] = []
        """Under way to the adviser: when they arrive, and what."""
        self._requests: list[tuple[float, Request]] = []
        """The same to robots."""
        self._answers: list[tuple[str, str, str]] = []
        self._waits: dict[int, dict[str, tuple[int, Request, list[tuple[int, int]]]]] = {}
        """By robot and request: the first visit that it may not begin, and by other robot its last visit there."""
        self._asked: set[tuple[str, str, tuple[float, float] | None, str | None]] = set()
        self._verbs: dict[str, int] = {}
        self._speeds: list[Floats] = []
        self._first_visits = self.traffic.driving["visit"].copy()
        self._near: set[tuple[int, int]] = set()
        self._encounters = 0
        for model in self.models:
            self._messages.append((0.0, json.loads(identity(model).message)))
        self.traffic.begin_step()

    @property
    def now_s(self) -> float:
        return float(START_S + self.traffic.now_s)

    @property
    def since_s(self) -> float:
        """Seconds since the start of the floor."""
        return self.traffic.now_s

    def step(self) -> None:
        """A tenth of a second."""
        traffic = self.traffic
        lines = reports(traffic, self.models, self._due[traffic.sample], self._rng)
        for line in lines:
            self._messages.append((line.received_s - START_S, json.loads(line.message)))
        for request in _arrived(self._requests, traffic.now_s):
            self._reach(request)
        self._end_waits()
        traffic.step()
        traffic.begin_step()
        self._score()

    def copied(self, draw: int) -> "CellWorld":
        """The same floor now, where no request is under way and later stalls are drawn anew."""
        copied = copy.deepcopy(self)
        copied.traffic.redraw(draw)
        copied._requests.clear()
        return copied

    def heard(self) -> list[dict[str, Any]]:
        """Messages that have arrived since the last call."""
        return _arrived(self._messages, self.traffic.now_s)

    def ask(self, request: Request) -> None:
        if not request.withdrawn:
            asked = (request.robot, request.verb, request.at, request.other)
            self._verbs[request.verb] = self._verbs.get(request.verb, 0) + (asked not in self._asked)
            self._asked.add(asked)
        self._requests.append((self.traffic.now_s + self._compliance.delay_s, request))

    def answers(self) -> list[tuple[str, str, str]]:
        found, self._answers = self._answers, []
        return found

    def figures(self) -> Figures:
        speeds = np.array(self._speeds)
        minutes = len(speeds) * STEP_S / 60
        robots = len(self.models)
        cells = (self.traffic.driving["visit"] - self._first_visits).sum()
        hours = robots * self.traffic.now_s / 3600
        vendors = np.array([model.vendor for model in self.models])
        by_vendor = {str(vendor): float(speeds[:, vendors == vendor].mean()) for vendor in np.unique(vendors)}
        requests = sum(self._verbs.values()) / hours
        encounters = self._encounters / (robots * minutes / 60)
        return Figures(float(speeds.mean()), float(cells / minutes), requests, encounters, by_vendor, self._verbs)

    def _reach(self, request: Request) -> None:
        """A request reaches its robot."""
        robot = self._row[request.robot]
        if request.withdrawn:
            self._waits.get(robot, {}).pop(request.id, None)
            self._restrict(robot)
            return
        if not self._obeys[robot]:
            if self._compliance.declines:
                self._answers.append((request.id, "declined", "busy"))
            return
        act = {"wait_before": self._wait_before, "go_first": _go_first, "go_around": self._go_around}
        why = act[request.verb](robot, request) if request.verb in act else "cannot"
        self._answers.append((request.id, "declined" if why else "accepted", why))

    def _wait_before(self, robot: int, request: Request) -> str:
        if request.at is None:
            return "cannot: no place"
        begun = int(self.traffic.driving["visit"][robot]) + 1
        visit = self._visit_at(robot, request.at, begun)
        if visit is None:
            return "not on its way"
        others = []
        for uuid in request.until:
            other = self._row[uuid]
            visits = self._visits_at(other, request.at)
            if visits:
                others.append((other, visits[0]))
        self._waits.setdefault(robot, {})[request.id] = (visit, request, others)
        self._restrict(robot)
        return ""

    def _go_around(self, robot: int, request: Request) -> str:
        if request.other is None:
            return "cannot: past whom"
        self.traffic.protection.set_out_around(self._scene(), robot, self._row[request.other])
        return ""

    def _visits_at(self, robot: int, at: tuple[float, float], least: int = 0) -> list[int]:
        visits, visit = self.traffic.fleets.visits, int(self.traffic.driving["visit"][robot])
        way = self.traffic.fleets.visits.ways[robot]
        last = min(visit + LOOKED_AHEAD, int(visits.count[robot]))
        span = slice(max(visit, least), last)
        near = (abs(way["x_m"][span] - at[0]) <= CELL_M / 2) & (abs(way["y_m"][span] - at[1]) <= CELL_M / 2)
        return (np.flatnonzero(near) + span.start).tolist()

    def _visit_at(self, robot: int, at: tuple[float, float], least: int) -> int | None:
        return next(iter(self._visits_at(robot, at, least)), None)

    def _restrict(self, robot: int) -> None:
        waits = self._waits.get(robot, {})
        self.traffic.driving["waits_before"][robot] = min((wait[0] for wait in waits.values()), default=NO_WAIT)

    def _end_waits(self) -> None:
        visit = self.traffic.driving["visit"]
        for robot, waits in self._waits.items():
            for name, (_, request, others) in list(waits.items()):
                has_passed = bool(others) and all(visit[other] > last for other, last in others)
                if has_passed or self.now_s >= request.latest_s:
                    del waits[name]
                    self._answers.append((name, "done", ""))
                    self._restrict(robot)

    def _scene(self) -> Scene:
        traffic = self.traffic
        none = np.zeros(len(self.models), bool)
        return Scene(
            traffic.now_s,
            traffic.grid,
            traffic.fleets.visits,
            traffic.driving,
            traffic.poses,
            traffic.present,
            none,
            none,
        )

    def _score(self) -> None:
        traffic = self.traffic
        if traffic.now_s < SCORED_FROM_S:
            self._first_visits = traffic.driving["visit"].copy()
            return
        self._speeds.append(traffic.driving["speed_mps"].copy())
        x_m, y_m = traffic.poses[:, 0], traffic.poses[:, 1]
        least_m = 2 * HALF_M[1] + NEAR_M
        a, b = np.nonzero(np.triu(np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m) < least_m, 1))
        near = set(zip(a.tolist(), b.tolist(), strict=True))
        self._encounters += len(near - self._near)
        self._near = near


def _go_first(_: int, __: Request) -> str:
    """A robot goes on by itself as soon as nothing is in its way."""
    return ""


def _arrived(under_way: list[tuple[float, Sent]], now_s: float) -> list[Sent]:
    """Take out what has arrived, in the order of arrival."""
    here = sorted((entry for entry in under_way if entry[0] <= now_s), key=lambda entry: entry[0])
    under_way[:] = [entry for entry in under_way if entry[0] > now_s]
    return [sent for _, sent in here]
