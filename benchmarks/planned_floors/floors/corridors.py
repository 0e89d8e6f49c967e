"""Corridors with two robots of two vendors each, which repeatedly drive towards each other.

`head_on`: both tell that they go straight on, brake, stand in front of each other, back off and start again.
`two_way`: they pass each other on lanes of their own, turn round at the ends and come back.
"""

from dataclasses import dataclass
from enum import IntEnum
from math import pi

import numpy as np

from benchmarks.planned_floors.logs.messages import (
    START_S,
    Line,
    Model,
    ahead,
    identity,
    latency_s,
    report_samples,
    status,
)
from benchmarks.planned_floors.logs.recording import Recording
from benchmarks.planned_floors.truth.floor_truth import FloorTruth, Stop, lost_s
from benchmarks.planned_floors.truth.motion import STEP_S, Bools, Motion
from ingest.batch import Floats, Ints

LENGTH_M, WIDTH_M = 0.9, 0.7
BRAKING_MPS2 = 1.0
BACKING_MPS = 0.8
TURN_S = 4.0
"""Duration of a half turn."""
AT_END_M = 0.01
VENDORS = ("Alder Robotics", "Birch Robotics")
STANDING_S = (3.0, 8.0)
"""Least and greatest time for which two robots stand after they met head-on."""


class Phase(IntEnum):
    """What a robot of a corridor does."""

    WAIT = 0
    """Stands at its end until the next start."""
    GO = 1
    BRAKE = 2
    STAND = 3
    """It stands in front of the other."""
    BACK = 4
    """It returns to its start."""
    TURN = 5


@dataclass(frozen=True, slots=True)
class Corridors:
    """The parameters of a floor of corridors."""

    kind: str = "head_on"
    """`head_on` or `two_way`."""
    seconds: float = 600.0
    corridors: int = 20
    length_m: float = 24.0
    apart_m: float = 10.0
    """Distance from one corridor to the next."""
    every_s: float = 40.0
    """Time from one encounter in a corridor to the next."""
    top_mps: float = 1.0
    """Speed; each robot is up to a tenth faster or slower."""
    gap_m: float = 0.6
    """Gap between the bodies when both stand head-on."""
    lateral_gap_m: float = 0.8
    """Gap between the bodies when they pass each other."""
    report_every_s: float = 1.0
    path_s: int = 10
    """Length in seconds of the path in its reports; 0 for none."""
    seed: int = 1


def travelled_m(t_s: Floats, distance_m: Floats, top_mps: float, speed_mps: Floats) -> Floats:
    """Metres gone `t_s` after now by one that goes `distance_m` and stands at its end, at `speed_mps` now.

    All broadcast against each other.
    """
    run_up_m = speed_mps**2 / (2 * BRAKING_MPS2)
    whole_m = np.maximum(distance_m + run_up_m, 1e-9)
    peak_mps = np.minimum(top_mps, np.sqrt(BRAKING_MPS2 * whole_m))
    rising_s = peak_mps / BRAKING_MPS2
    cruising_s = whole_m / peak_mps - rising_s
    after_s = np.clip(t_s + speed_mps / BRAKING_MPS2, 0.0, 2 * rising_s + cruising_s)
    up_s, down_s = np.minimum(after_s, rising_s), np.maximum(after_s - rising_s - cruising_s, 0.0)
    gone_m: Floats = BRAKING_MPS2 * up_s**2 / 2 + peak_mps * (after_s - up_s) - BRAKING_MPS2 * down_s**2 / 2
    return gone_m - run_up_m


class Trace:
    """The motion of one robot at s samples. Arrays are (s,)."""

    def __init__(self, samples: int) -> None:
        self.gone_m = np.zeros(samples)
        """Distance from the end where it set out."""
        self.speed_mps = np.zeros(samples)
        """Negative when backing."""
        self.phase = np.zeros(samples, np.int64)
        self.turned_rad = np.zeros(samples)
        """Seconds since the start."""
        self.returning = np.zeros(samples, bool)
        """Whether it set out at the far end."""

    def keep(self, sample: int, robot: "_Robot") -> None:
        self.gone_m[sample], self.speed_mps[sample], self.phase[sample] = robot.gone_m, robot.speed_mps, robot.phase
        self.turned_rad[sample], self.returning[sample] = robot.turned_rad, robot.returning


@dataclass(slots=True)
class _Robot:
    """One robot of a corridor at one time."""

    top_mps: float
    gone_m: float = 0.0
    speed_mps: float = 0.0
    phase: Phase = Phase.WAIT
    turned_rad: float = 0.0
    returning: bool = False

    def advance(self, length_m: float) -> None:
        """Advance by one step of the phase, and end the phase if it is complete."""
        faster_mps = abs(self.speed_mps) + BRAKING_MPS2 * STEP_S
        if self.phase is Phase.GO:
            self.speed_mps = min(faster_mps, self.top_mps, (2 * BRAKING_MPS2 * max(length_m - self.gone_m, 0)) ** 0.5)
        elif self.phase is Phase.BACK:
            self.speed_mps = -min(faster_mps, BACKING_MPS, (2 * BRAKING_MPS2 * max(self.gone_m, 0)) ** 0.5)
        else:
            self.speed_mps = max(self.speed_mps - BRAKING_MPS2 * STEP_S, 0.0)
        self.gone_m += self.speed_mps * STEP_S
        if self.phase is Phase.BACK and self.gone_m < AT_END_M:
            self.phase, self.speed_mps = Phase.WAIT, 0.0
        elif self.phase is Phase.GO and self.gone_m > length_m - AT_END_M:
            self.phase, self.speed_mps, self.gone_m = Phase.TURN, 0.0, length_m
        elif self.phase is Phase.TURN:
            self._turn()

    def _turn(self) -> None:
        self.turned_rad += pi * STEP_S / TURN_S
        if self.turned_rad >= pi * (1 if not self.returning else 2) - 1e-9:
            self.turned_rad, self.returning = (0.0, False) if self.returning else (pi, True)
            self.phase, self.gone_m = Phase.WAIT, 0.0


def simulate(floor: Corridors) -> Recording:
    """Two robots in each corridor. The robot of the second vendor starts at the far end."""
    rng = np.random.default_rng([floor.seed, 17])
    samples = round(floor.seconds / STEP_S)
    lines: list[Line] = []
    stops: list[Stop] = []
    models, poses = [], []
    for corridor in range(floor.corridors):
        pair = [_model(floor, corridor, vendor, rng) for vendor in VENDORS]
        first_start_s = rng.uniform(0, floor.every_s)
        traces, found = _drive(floor, pair, first_start_s, samples, rng)
        stops += found
        for side, (model, trace) in enumerate(zip(pair, traces, strict=True)):
            teller = _Teller(floor, corridor, side, first_start_s, model, trace)
            models.append(model)
            poses.append(teller.poses(trace.gone_m, trace.turned_rad, trace.returning))
            lines += teller.reports(samples, rng)
    x_m, y_m, yaw_rad = (np.stack([pose[:, k] for pose in poses], axis=1) for k in range(3))
    half_m = np.array([[LENGTH_M / 2] * len(models), [WIDTH_M / 2] * len(models)])
    motion = Motion(START_S, tuple(model.uuid for model in models), x_m, y_m, yaw_rad, half_m)
    stops.sort(key=lambda stop: (stop.start_s, stop.robot))
    return Recording([identity(model) for model in models] + lines, FloorTruth(motion, stops, []))


def _model(floor: Corridors, corridor: int, vendor: str, rng: np.random.Generator) -> Model:
    top_mps = floor.top_mps * rng.uniform(0.9, 1.1)
    return Model(f"{floor.kind}-{floor.seed}-{vendor[0]}{corridor:03d}", vendor, LENGTH_M, WIDTH_M, top_mps)


def _drive(
    floor: Corridors, models: list[Model], first_start_s: float, samples: int, rng: np.random.Generator
) -> tuple[list[Trace], list[Stop]]:
    """The motion of the two robots of one corridor, and their stops."""
    robots, traces = [_Robot(model.top_mps) for model in models], [Trace(samples) for _ in models]
    stops: list[Stop] = []
    brakes_s, stands_until_s, v0_mps, standing_s = 0.0, 0.0, [0.0, 0.0], 0.0
    for sample in range(samples):
        for robot, trace in zip(robots, traces, strict=True):
            trace.keep(sample, robot)
        t_s = sample * STEP_S
        if all(robot.phase is Phase.WAIT for robot in robots) and (t_s - first_start_s) % floor.every_s < STEP_S:
            _set(robots, Phase.GO)
        elif floor.kind == "head_on" and robots[0].phase is Phase.GO and _must_brake(floor, robots):
            brakes_s, v0_mps, standing_s = t_s, [robot.speed_mps for robot in robots], float(rng.uniform(*STANDING_S))
            _set(robots, Phase.BRAKE)
        elif robots[0].phase is Phase.BRAKE and not any(robot.speed_mps for robot in robots):
            stands_until_s = t_s + standing_s
            _set(robots, Phase.STAND)
        elif robots[0].phase is Phase.STAND and t_s >= stands_until_s:
            stops += _stops(models, brakes_s, t_s, v0_mps, standing_s)
            _set(robots, Phase.BACK)
        for robot in robots:
            robot.advance(floor.length_m)
    if robots[0].phase in {Phase.BRAKE, Phase.STAND}:
        stops += _stops(models, brakes_s, samples * STEP_S, v0_mps, standing_s)
    return traces, stops


def _set(robots: list[_Robot], phase: Phase) -> None:
    for robot in robots:
        robot.phase = phase


def _must_brake(floor: Corridors, robots: list[_Robot]) -> bool:
    """Whether the two would come nearer than the gap if they braked a step later."""
    between_m = floor.length_m - sum(robot.gone_m for robot in robots) - LENGTH_M
    needed_m = sum(robot.speed_mps**2 / (2 * BRAKING_MPS2) + robot.speed_mps * STEP_S for robot in robots)
    return between_m <= floor.gap_m + needed_m


def _stops(models: list[Model], start_s: float, end_s: float, v0_mps: list[float], standing_s: float) -> list[Stop]:
    """Both robots stop for each other."""
    return [
        Stop(
            robot=robot.uuid,
            by=other.uuid,
            start_s=START_S + start_s,
            end_s=START_S + end_s,
            v0_mps=speed_mps,
            standing_s=standing_s,
            same_vendor=False,
            around=False,
            around_until_s=START_S + end_s,
            lost_s=lost_s(speed_mps, end_s - start_s, standing_s),
        )
        for robot, other, speed_mps in zip(models, reversed(models), v0_mps, strict=True)
    ]


class _Teller:
    """The reports of one robot of a corridor."""

    def __init__(
        self, floor: Corridors, corridor: int, side: int, first_start_s: float, model: Model, trace: Trace
    ) -> None:
        self._floor, self._first_start_s, self._model, self._trace = floor, first_start_s, model, trace
        self._side = side
        aside_m = (WIDTH_M + floor.lateral_gap_m) / 2 if floor.kind == "two_way" else 0.0
        self._y_m = corridor * floor.apart_m + (aside_m if side else -aside_m)

    def poses(self, gone_m: Floats, turned_rad: Floats, returning: Bools) -> Floats:
        """(..., 3) x, y, yaw on the floor."""
        from_west = (self._side == 0) != returning
        x_m = np.where(from_west, gone_m, self._floor.length_m - gone_m)
        return np.stack([x_m, np.full(x_m.shape, self._y_m), turned_rad + pi * self._side], axis=-1)

    def reports(self, samples: int, rng: np.random.Generator) -> list[Line]:
        due = np.array(report_samples(rng, samples, STEP_S, self._floor.report_every_s))
        trace, lines = self._trace, []
        poses = self.poses(trace.gone_m[due], trace.turned_rad[due], trace.returning[due]).tolist()
        speeds_mps, uuid = trace.speed_mps[due].tolist(), self._model.uuid
        for sample, pose, speed_mps, path in zip(due.tolist(), poses, speeds_mps, self._paths(due), strict=True):
            t_s = START_S + sample * STEP_S
            lines.append(status(uuid, t_s, latency_s(rng), "navigating", pose, speed_mps, path))
        return lines

    def _paths(self, due: Ints) -> Floats:
        """(n, k, 4) what it means to do at samples `due`: to go on at once where it brakes or stands, to go back, to
        turn, and to start when it is time."""
        trace, length_m = self._trace, self._floor.length_m
        now_s: Floats = due[:, None].astype(np.float64) * STEP_S
        at_s = ahead(now_s, self._floor.path_s)
        after_s = at_s - now_s
        gone_m, speed_mps = trace.gone_m[due, None], np.abs(trace.speed_mps[due, None])
        turned_rad, returning = trace.turned_rad[due, None], trace.returning[due, None]
        phase, n = trace.phase[due, None], (len(due), self._floor.path_s)
        waiting = (phase == Phase.WAIT) | (phase == Phase.BACK)
        turning = phase == Phase.TURN
        onward_m = gone_m + travelled_m(after_s, length_m - gone_m, self._model.top_mps, speed_mps)
        back_m = gone_m - travelled_m(after_s, gone_m, BACKING_MPS, speed_mps)
        along_m = np.where(waiting, self._started(back_m, now_s, at_s), np.where(turning, gone_m, onward_m))
        turned_most = np.where(returning, 2 * pi, pi)
        turned = np.where(turning, np.minimum(turned_rad + after_s * pi / TURN_S, turned_most), turned_rad)
        poses = self.poses(along_m, turned, np.broadcast_to(returning, n))
        return np.concatenate([START_S + at_s[..., None], poses], axis=-1)

    def _started(self, along_m: Floats, now_s: Floats, at_s: Floats) -> Floats:
        """Its position at `at_s`, including its next start after `now_s`."""
        every_s = self._floor.every_s
        starts_s = self._first_start_s + np.maximum(np.ceil((now_s - self._first_start_s) / every_s), 0) * every_s
        distance_m, standing_mps = np.full(1, self._floor.length_m), np.zeros(1)
        going_m = travelled_m(at_s - starts_s, distance_m, self._model.top_mps, standing_mps)
        return np.where(at_s > starts_s, going_m, along_m)
