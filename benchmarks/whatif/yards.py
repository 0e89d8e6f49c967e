"""Yards: small floors with few robots, what truly happens there, and the log of them."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from benchmarks.planned_floors.logs.messages import START_S, Line, Model, identity, latency_s, status
from benchmarks.whatif.heard_lines import heard
from deconflict.simulation.driving.motion import Activity, MovingRobots
from deconflict.simulation.driving.passing import HALF_AISLE_M
from deconflict.simulation.participants import ALDER, BASALT, CORVID, Make
from ingest.batch import Floats, Ints
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.model_runs import FloorFigures, OpenLosses

MAKES = (ALDER, CORVID, BASALT)
PATH_S = 10
REPORT_S = 1.0


class Yard(MovingRobots):
    """The robots of a yard, each of the next of these makes in turn."""

    step_s = 0.1

    def __init__(
        self, robots: int, rng: np.random.Generator, makes: Sequence[Make] = MAKES, half_aisle_m: float = HALF_AISLE_M
    ) -> None:
        self.makes = [makes[number % len(makes)] for number in range(robots)]
        super().__init__(self.makes, np.arange(robots) % len(makes), (), rng, half_aisle_m)
        self.arrivals = 0

    @property
    def floor(self) -> Ints:
        return np.zeros(len(self), np.int64)

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

    def heading_rad(self, robot: int) -> float:
        return float(self.tracks.poses(np.array(robot), self.progress_m[robot])[2])


MadeYard = Callable[[np.random.Generator], Yard]


def yard_figures(made: MadeYard, seed: int, seconds: float) -> FloorFigures:
    """What truly happens, per hour."""
    yard = made(np.random.default_rng(seed))
    losses = OpenLosses(yard)
    while yard.t_s < seconds:
        yard.step(yard.step_s)
        losses.update(yard.step_s)
    lost_s, delays = losses.finish()
    return FloorFigures(float(lost_s.sum()), yard.arrivals, float(delays.sum())).per_hour(seconds)


def recorded_yard(made: MadeYard, seed: int, seconds: float) -> RecordedFloor:
    """The log of a yard, as the service hears it."""
    return heard(reports(made(np.random.default_rng(seed)), seconds))


def reports(yard: Yard, seconds: float, name: str = "yard", east_m: float = 0.0) -> Iterator[Line]:
    """What the robots of a yard report that lies so far east of where it was drawn."""
    rng, east = np.random.default_rng(1), np.array([0.0, east_m, 0.0, 0.0])
    models = [
        Model(f"{name}-{row}", make.vendor.value, make.body.length_m, make.body.width_m, make.max_speed_mps)
        for row, make in enumerate(yard.makes)
    ]
    yield from (identity(model) for model in models)
    report_steps = round(REPORT_S / yard.step_s)
    while yard.t_s < seconds:
        yard.step(yard.step_s)
        now_s, poses = START_S + yard.t_s, yard.envelopes()
        for row in range(round(yard.t_s / yard.step_s) % report_steps, len(models), report_steps):
            speed_mps = float(yard.speed_mps[row])
            state = "waitingExternalEvent" if yard.doing[row] == Activity.STANDING else "navigating"
            x_m, y_m, yaw_rad = poses[row, :3].tolist()
            pose = x_m + east_m, y_m, yaw_rad
            yield status(models[row].uuid, now_s, latency_s(rng), state, pose, speed_mps, yard.path(row) + east)
