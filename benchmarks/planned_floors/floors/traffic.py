"""A floor of cells in time steps: robots plan, drive, stop for each other, stall, become silent and come back."""

from math import floor

import numpy as np

from benchmarks.planned_floors.floors.absences import Absence, drawn
from benchmarks.planned_floors.floors.driving.driving import (
    AWAITS_ORDER,
    DRIVING,
    GOES,
    NO_PLAN,
    NO_WAIT,
    TURNS,
    Driving,
    advance,
    next_moves,
)
from benchmarks.planned_floors.floors.driving.grid import Grid, racks, scattered, sortation, warehouse
from benchmarks.planned_floors.floors.habits import GridFloor, Habits
from benchmarks.planned_floors.floors.planning.fleets import Fleets
from benchmarks.planned_floors.floors.planning.step_fleets import StepFleets
from benchmarks.planned_floors.floors.protection.protective_stops import Protection
from benchmarks.planned_floors.floors.protection.scene import Scene
from benchmarks.planned_floors.truth.motion import STEP_S, Bools
from ingest.batch import Floats, Ints

NOMINAL_MPS = 1.5
"""Speed that vendors assume for their robots. Each robot is up to a tenth faster or slower."""
PLANS_EVERY = 10
"""Steps."""


def _grid(made_of: GridFloor, rng: np.random.Generator) -> Grid:
    size = made_of.width, made_of.height
    if made_of.layout == "warehouse":
        return warehouse(*size)
    if made_of.layout == "sortation":
        return sortation(*size)
    if made_of.layout == "scattered":
        return scattered(*size, rng)
    return racks(*size, made_of.aisle_cells, rng, made_of.one_way_x)


class Traffic:
    """All robots of one floor. Arrays are (n,) unless stated."""

    def __init__(self, made_of: GridFloor) -> None:
        layout_rng, plan_rng, self._rng, silence_rng = (np.random.default_rng([made_of.seed, k]) for k in range(4))
        self.habits: list[Habits] = [habits for habits in made_of.vendors for _ in range(habits.robots)]
        n = len(self.habits)
        self._made_of = made_of
        self.grid = _grid(made_of, layout_rng)
        fleet_of = [fleet for fleet, habits in enumerate(made_of.vendors) for _ in range(habits.robots)]
        self.fleet_rows: list[Ints] = [
            np.flatnonzero(np.array(fleet_of) == fleet) for fleet in range(max(fleet_of) + 1)
        ]
        self.fleet_of = fleet_of
        self.fleets = (
            Fleets(self.grid, fleet_of, plan_rng)
            if made_of.layout == "racks"
            else StepFleets(self.grid, fleet_of, plan_rng, made_of.seconds)
        )
        self.driving: Driving = np.zeros(n, DRIVING)
        self.poses: Floats = np.zeros((n, 3))
        """(n, 3) x, y, yaw"""
        self.present: Bools = np.ones(n, bool)
        self.moves: Ints = np.full(n, NO_PLAN)
        """(n,) next action of each robot, see `driving`."""
        self.silent: Bools = np.zeros(n, bool)
        self.absences: list[list[Absence]] = drawn(made_of, n, silence_rng)
        self.sample = 0
        self._stands: Bools = np.zeros(n, bool)
        """(n,) whether each robot stands because it is silent."""
        self._stalled_until_s: Floats = np.zeros(n)
        top_mps = NOMINAL_MPS * self._rng.uniform(0.9, 1.1, n)
        patience_s = self._rng.uniform(*made_of.patience_s, n)
        kinds = [habits.protection for habits in self.habits]
        self.protection = Protection(kinds, top_mps, patience_s, made_of.around_aside_m)
        self.driving["waits_before"], self.driving["turns_aside_m"] = NO_WAIT, made_of.turns_aside_m
        self.driving["yaw_rad"] = self._rng.integers(0, 4, n) * np.pi / 2
        advance(self.driving, self.fleets.visits.count, self.fleets.visits.ways, self.poses)

    @property
    def now_s(self) -> float:
        return self.sample * STEP_S

    def redraw(self, draw: int) -> None:
        """Draw the stalls from now on anew."""
        self._rng = np.random.default_rng([self._made_of.seed, 12, draw])

    def begin_step(self) -> None:
        """Plan, and update which robots are silent, carried away or back."""
        if self.sample % PLANS_EVERY == 0:
            self.fleets.plan(self.driving, self.present)
        self._stands = self._silences()

    def step(self) -> None:
        """Advance by `STEP_S`. Call it after `begin_step`."""
        stands, visits = self._stands | self._stalls(), self.fleets.visits
        self.moves = next_moves(self.driving, visits.count, visits.ways)
        wanting = self.present & ~stands & ((self.moves == GOES) | (self.moves == TURNS))
        turning = wanting & (self.moves == TURNS)
        scene = Scene(self.now_s, self.grid, visits, self.driving, self.poses, self.present, wanting, turning)
        self.driving["top_mps"] = np.where(stands | ~self.present, 0.0, self.protection.react(scene))
        advance(self.driving, self.fleets.visits.count, self.fleets.visits.ways, self.poses)
        self.sample += 1

    def waits_for_order(self, robot: int) -> bool:
        """Whether a robot stands until its own fleet lets it into the next cell."""
        return bool(self.moves[robot] == AWAITS_ORDER)

    def _stalls(self) -> Bools:
        """(n,) whether each robot stalls. A yielding robot does not begin to stall."""
        begins = self._rng.random(len(self.present)) < self._made_of.stalls_per_s * STEP_S
        lasts_s = self._rng.uniform(*self._made_of.stall_s, len(self.present))
        gives_way = np.array([note is not None for note in self.protection.stopped])
        begins &= (self._stalled_until_s <= self.now_s) & ~gives_way
        self._stalled_until_s[begins] = self.now_s + lasts_s[begins]
        return self._stalled_until_s > self.now_s

    def _silences(self) -> Bools:
        """(n,) whether each robot stands because it is silent. Also carries robots away and brings them back."""
        stands = np.zeros(len(self.present), bool)
        for robot, absences in enumerate(self.absences):
            current = next((absence for absence in absences if absence.start_s <= self.now_s < absence.end_s), None)
            self.silent[robot] = current is not None or not self.present[robot]
            if current is None:
                if not self.present[robot]:
                    self._put_back(robot, absences)
                continue
            stands[robot] = current.stands
            if current.gone_s is not None and current.gone_s <= self.now_s and self.present[robot]:
                self._carry_away(robot)
        return stands

    def _carry_away(self, robot: int) -> None:
        self.present[robot] = False
        self.protection.withdraw(robot, self.now_s)
        self.fleets.withdraw(robot, int(self.driving["visit"][robot]))
        for name in ("gone_m", "speed_mps", "aside_m", "aside_to_m"):
            self.driving[name][robot] = 0.0

    def _put_back(self, robot: int, absences: list[Absence]) -> None:
        """End a robot's silence now, or as soon as there is room for it."""
        if self.fleets.put_back(robot, self.driving, self.poses, self.present):
            visits = self.fleets.visits
            visit = int(visits.count[robot]) - 1
            self.driving["visit"][robot] = visit
            self.poses[robot, :2] = visits.ways["x_m"][robot, visit], visits.ways["y_m"][robot, visit]
            self.present[robot] = True
        else:
            past = [absence for absence in absences if absence.end_s <= self.now_s]
            last = max(past, key=lambda absence: absence.end_s)
            last.end_s = floor(self.now_s) + 1.0 + STEP_S
