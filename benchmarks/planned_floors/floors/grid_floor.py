"""Recordings of floors of cells: the reports of the driving robots, and the truth."""

import numpy as np

from benchmarks.planned_floors.floors.driving.driving import NO_WAIT, foreseen
from benchmarks.planned_floors.floors.habits import GridFloor
from benchmarks.planned_floors.floors.protection.scene import HALF_M, LENGTH_M, WIDTH_M
from benchmarks.planned_floors.floors.protection.stop_notes import STANDS_MPS
from benchmarks.planned_floors.floors.traffic import NOMINAL_MPS, Traffic
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
from benchmarks.planned_floors.truth.floor_truth import FloorTruth, Silence
from benchmarks.planned_floors.truth.motion import STEP_S, Motion
from ingest.batch import Floats

TOP_MPS = 1.8
"""Values that robots report about themselves."""
CELL_S = 1.3
"""Time that vendors assume for one cell of an errand."""


def simulate(made_of: GridFloor) -> Recording:
    """The log of a floor and its truth."""
    traffic, rng = Traffic(made_of), np.random.default_rng([made_of.seed, 9])
    models = models_of(made_of)
    samples = round(made_of.seconds / STEP_S)
    due = due_reports(traffic, samples, rng)
    motion = np.full((3, samples, len(models)), np.nan)
    lines = [identity(model) for model in models]
    for sample in range(samples):
        traffic.begin_step()
        motion[:, sample, traffic.present] = traffic.poses[traffic.present].T
        robots = [robot for robot in due[sample] if not traffic.silent[robot]]
        lines += reports(traffic, models, robots, rng)
        traffic.step()
    traffic.protection.finish(traffic.now_s)
    x_m, y_m, yaw_rad = motion
    half_m = np.repeat(HALF_M[:, None], len(models), axis=1)
    moved = Motion(START_S, tuple(model.uuid for model in models), x_m, y_m, yaw_rad, half_m)
    uuids, vendors = [model.uuid for model in models], [model.vendor for model in models]
    stops = [note.stop(START_S, uuids, vendors) for note in traffic.protection.notes]
    stops.sort(key=lambda stop: (stop.start_s, stop.robot))
    return Recording(lines, FloorTruth(moved, stops, _silences(traffic, moved)))


def models_of(made_of: GridFloor) -> list[Model]:
    serials = [
        (habits.vendor, f"{made_of.kind}-{made_of.seed}-{habits.vendor[0]}{number:03d}")
        for habits in made_of.vendors
        for number in range(habits.robots)
    ]
    return [Model(serial, vendor, LENGTH_M, WIDTH_M, TOP_MPS) for vendor, serial in serials]


def due_reports(traffic: Traffic, samples: int, rng: np.random.Generator) -> list[list[int]]:
    """By sample: the robots that report then."""
    due: list[list[int]] = [[] for _ in range(samples)]
    for robot, habits in enumerate(traffic.habits):
        for sample in report_samples(rng, samples, STEP_S, habits.report_every_s):
            due[sample].append(robot)
    return due


def reports(traffic: Traffic, models: list[Model], robots: list[int], rng: np.random.Generator) -> list[Line]:
    lines = []
    paths: dict[int, Floats] = {}
    for fleet in sorted({traffic.fleet_of[robot] for robot in robots}):
        paths |= _paths(traffic, fleet, [robot for robot in robots if traffic.fleet_of[robot] == fleet])
    for robot in robots:
        t_s, speed_mps = START_S + traffic.now_s, float(traffic.driving["speed_mps"][robot])
        pose, uuid = traffic.poses[robot].tolist(), models[robot].uuid
        destination = _destination(traffic, robot, t_s)
        state = _state(traffic, robot, speed_mps)
        lines.append(status(uuid, t_s, latency_s(rng), state, pose, speed_mps, paths[robot], destination))
    return lines


def _state(traffic: Traffic, robot: int, speed_mps: float) -> str:
    if not traffic.habits[robot].tells_waiting or speed_mps >= STANDS_MPS:
        return "navigating"
    if traffic.protection.stopped[robot]:
        return "waitingExternalEvent"
    return "waitingInternalEvent" if traffic.waits_for_order(robot) else "navigating"


def _destination(traffic: Traffic, robot: int, t_s: float) -> tuple[float, float, float] | None:
    errand = traffic.fleets.errand(robot, int(traffic.driving["visit"][robot]))
    return (t_s + errand[0] * CELL_S, errand[1], errand[2]) if errand else None


def _paths(traffic: Traffic, fleet: int, robots: list[int]) -> dict[int, Floats]:
    """By robot (k, 4) where its vendor's plan takes it.

    It knows of no stall to come, takes a present stall or stop to be over at once, and does not know other vendors.
    """
    habits = traffic.habits[robots[0]]
    if not habits.path_s:
        return dict.fromkeys(robots, np.empty((0, 4)))
    at_s = ahead(np.array([[traffic.now_s]]), habits.path_s)[0]
    first = round((at_s[0] - traffic.now_s) / STEP_S)
    driving = traffic.driving.copy()
    driving["top_mps"] = NOMINAL_MPS
    driving["aside_to_m"] = 0.0
    driving["waits_before"] = NO_WAIT
    rows = traffic.fleet_rows[fleet] if habits.tells_order else np.array(robots)
    rows = rows[traffic.present[rows]]
    visits = traffic.fleets.visits
    poses = foreseen(driving, visits.count, visits.ways, rows, habits.tells_order, first, habits.path_s)
    times = START_S + at_s[:, None]
    return {robot: np.hstack([times, poses[row]]) for row, robot in enumerate(rows.tolist()) if robot in robots}


def _silences(traffic: Traffic, motion: Motion) -> list[Silence]:
    """The silences that began, and the robot's position at the begin of each."""
    found = []
    for robot, absences in enumerate(traffic.absences):
        for absence in absences:
            start_s = START_S + absence.start_s
            sample = motion.sample(start_s)
            gone_s = None if absence.gone_s is None else START_S + absence.gone_s
            place_m = float(motion.x_m[sample, robot]), float(motion.y_m[sample, robot])
            end_s = min(START_S + absence.end_s, motion.end_s)
            found.append(Silence(motion.robots[robot], start_s, end_s, gone_s, *place_m))
    return sorted(found, key=lambda silence: (silence.start_s, silence.robot))
