"""A yard where robots queue for docks: what happens there, and the log of it.

Robots drive counterclockwise around a loop from their own rack to the docks and back. They choose a dock with the
fewest robots on their way to it, and queue behind each other.
"""

from collections.abc import Iterator

import numpy as np
import shapely

from benchmarks.planned_floors.logs.messages import START_S, Line, Model, identity, latency_s, status
from benchmarks.whatif.heard_lines import heard
from deconflict.simulation.driving.motion import Activity, MovingRobots
from deconflict.simulation.driving.routes import drive, standing
from deconflict.simulation.floor_layout import Place
from deconflict.simulation.participants import ALDER, BASALT, CORVID
from ingest.batch import Floats, Ints
from metrics.whatif.change import NamedOutline
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.model_runs import FloorFigures, OpenLosses

MAKES = (ALDER, CORVID, BASALT)
STEP_S = 0.1
DOCK_S, RACK_S = (15.0, 25.0), (20.0, 60.0)
"""Ranges of the stay at a dock and at the rack."""
DOCK_X_M, NEXT_DOCK_M, RACKS_Y_M = 20.0, -1.9, 12.0
DOCK = NamedOutline("Dock", 0, shapely.box(DOCK_X_M - 1.5, -0.8, DOCK_X_M + 1.5, 0.8))
PATH_S = 10
REPORT_STEPS = 10
"""Each robot reports once in so many steps."""


class DockYard(MovingRobots):
    """The robots of a yard."""

    def __init__(self, robots: int, docks: int, rng: np.random.Generator) -> None:
        makes = [MAKES[number % len(MAKES)] for number in range(robots)]
        super().__init__(makes, np.arange(robots) % len(MAKES), (), rng)
        self._racks = [(6.0 + 4.0 * number, RACKS_Y_M) for number in range(robots)]
        self._docks, self._dock_of = docks, np.full(robots, -1)
        """(n,) the dock at which, or on the way to which, each is."""
        self.arrivals = 0
        self.until_s = rng.uniform(0.0, RACK_S[1], robots)
        for robot, rack in enumerate(self._racks):
            self._place(robot, standing(rack, np.pi / 2))

    @property
    def floor(self) -> Ints:
        return np.zeros(len(self), np.int64)

    def _leave(self, robot: int) -> None:
        yaw_rad = float(self.tracks.poses(np.array(robot), self.progress_m[robot])[2])
        if self._dock_of[robot] < 0:
            counts = [int((self._dock_of == dock).sum()) for dock in range(self._docks)]
            self._dock_of[robot] = int(np.argmin(counts))
            corners = _to_dock(self._racks[robot], int(self._dock_of[robot]))
        else:
            corners = _to_dock(self._racks[robot], int(self._dock_of[robot]), back=True)
            self._dock_of[robot] = -1
        self._set_out(robot, drive(corners, yaw_rad, self._makes[robot]), [])

    def _arrived(self, robot: int) -> float:
        self.arrivals += 1
        return float(self._rng.uniform(*(RACK_S if self._dock_of[robot] < 0 else DOCK_S)))

    def path(self, robot: int) -> Floats:
        """(k, 4) t_s, x, y, yaw of its plan, once a second: as if it were alone."""
        drives = self.doing[robot] == Activity.DRIVING
        length_m = float(self.tracks.length_m[robot]) if drives else float(self.progress_m[robot])
        at_m = np.linspace(float(self.progress_m[robot]), length_m, 400)
        rows = np.full(len(at_m), robot)
        due_s = self.tracks.seconds(rows, at_m) - self.tracks.seconds(rows[:1], at_m[:1])
        after_s = np.arange(1.0, PATH_S + 1)
        poses = self.tracks.poses(rows[: len(after_s)], np.interp(after_s, due_s, at_m))
        return np.column_stack([START_S + self.t_s + after_s, *poses])


def _to_dock(rack: Place, dock: int, *, back: bool = False) -> list[Place]:
    """The way from a rack to a dock, or back."""
    x_m, y_m = DOCK_X_M, NEXT_DOCK_M * dock
    if back:
        beyond = [(x_m + 3.0, y_m), (x_m + 6.0, 0.0)] if dock else []
        return [(x_m, y_m), *beyond, (50.0, 0.0), (50.0, 16.0), (rack[0], 16.0), rack]
    before = [(x_m - 6.0, 0.0), (x_m - 3.0, y_m)] if dock else []
    return [rack, (rack[0], 8.0), (0.0, 8.0), (0.0, 0.0), *before, (x_m, y_m)]


def yard_figures(robots: int, docks: int, seed: int, seconds: float) -> FloorFigures:
    """What truly happens, per hour."""
    yard = DockYard(robots, docks, np.random.default_rng(seed))
    losses = OpenLosses(yard)
    while yard.t_s < seconds:
        yard.step(STEP_S)
        losses.update(STEP_S)
    lost_s, delays = losses.finish()
    return FloorFigures(float(lost_s.sum()), yard.arrivals, float(delays.sum())).per_hour(seconds)


def recorded_yard(robots: int, seed: int, seconds: float) -> RecordedFloor:
    """The log of the yard with one dock, as the service hears it."""
    return heard(_reports(DockYard(robots, 1, np.random.default_rng(seed)), seconds))


def _reports(yard: DockYard, seconds: float) -> Iterator[Line]:
    rng = np.random.default_rng(1)
    makes = (MAKES * len(yard))[: len(yard)]
    models = [
        Model(f"yard-{row}", make.vendor.value, make.body.length_m, make.body.width_m, make.max_speed_mps)
        for row, make in enumerate(makes)
    ]
    yield from (identity(model) for model in models)
    while yard.t_s < seconds:
        yard.step(STEP_S)
        now_s, poses = START_S + yard.t_s, yard.envelopes()
        for row in range(round(yard.t_s / STEP_S) % REPORT_STEPS, len(models), REPORT_STEPS):
            speed_mps = float(yard.speed_mps[row])
            state = "waitingExternalEvent" if yard.doing[row] == Activity.STANDING else "navigating"
            pose = poses[row, :3].tolist()
            yield status(models[row].uuid, now_s, latency_s(rng), state, pose, speed_mps, yard.path(row))
