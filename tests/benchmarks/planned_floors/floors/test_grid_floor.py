import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.planned_floors.floors.driving.grid import CELL_M
from benchmarks.planned_floors.floors.grid_floor import simulate
from benchmarks.planned_floors.floors.habits import GridFloor, Habits
from benchmarks.planned_floors.logs.recording import Recording
from benchmarks.planned_floors.logs.reports import Robot, reported_motion, robots_in_file, robots_of_lines
from benchmarks.planned_floors.truth.encounters import encounters
from benchmarks.planned_floors.truth.floor_truth import LOG, Stop, load
from benchmarks.planned_floors.truth.motion import STEP_S, Motion
from benchmarks.planned_floors.truth.outcomes import FRESH_MPS, natural
from ingest.batch import Floats

BLIND = GridFloor(
    "blind", tuple(Habits(vendor, 5) for vendor in ("Alder", "Birch", "Corvid")), seconds=90.0, width=14, height=14
)
SWERVING = replace(BLIND, vendors=tuple(replace(habits, protection="swerve") for habits in BLIND.vendors))
OWN = GridFloor("own", (Habits("Alder", 14),), seconds=90.0, width=14, height=14)


@pytest.fixture(scope="module")
def blind() -> Recording:
    return simulate(BLIND)


def test_the_same_seed_gives_the_same_bytes(blind: Recording, tmp_path: Path) -> None:
    blind.save(tmp_path / "a", {})
    simulate(BLIND).save(tmp_path / "b", {})
    for file in sorted((tmp_path / "a").iterdir()):
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes(), file.name
    other = simulate(replace(BLIND, seed=2))
    assert other.lines != blind.lines


def test_robots_touch_only_while_one_drives_around_another(blind: Recording) -> None:
    met = encounters(blind.truth.motion, 0.0)
    assert met, "no robot drives around another: nothing is tested"
    assert natural(met, blind.truth.stops) == []


def test_robots_of_one_fleet_keep_their_order() -> None:
    assert encounters(simulate(OWN).truth.motion, 0.3) == []


def test_robots_move_no_faster_than_they_can(blind: Recording) -> None:
    motion = blind.truth.motion
    step_m = np.hypot(np.diff(motion.x_m, axis=0), np.diff(motion.y_m, axis=0))
    assert np.nanmax(step_m) / STEP_S < 1.5 * 1.1 + 0.4


def test_stops_agree_with_the_motion(blind: Recording) -> None:
    motion = blind.truth.motion
    stood = [stop for stop in blind.truth.stops if stop.standing_s >= 1.0]
    assert len(stood) > 10
    for stop in stood:
        first, last, column = motion.sample(stop.start_s), motion.sample(stop.end_s), motion.robots.index(stop.robot)
        other = motion.robots.index(stop.by)
        moved_m = np.hypot(np.diff(motion.x_m[:, column]), np.diff(motion.y_m[:, column]))
        assert np.count_nonzero(moved_m[first:last] < 1e-3) * STEP_S >= stop.standing_s - 0.5
        if stop.v0_mps > FRESH_MPS:
            assert moved_m[first - 1] / STEP_S == pytest.approx(stop.v0_mps, abs=0.2)
        away_m = np.hypot(*(places[first, column] - places[first, other] for places in (motion.x_m, motion.y_m)))
        assert away_m < 5.0


def test_reported_paths_are_followed_without_obstacles() -> None:
    alone = replace(OWN, vendors=(Habits("Alder", 3),), stalls_per_s=0.0)
    recording = simulate(alone)
    motion, errors_m = recording.truth.motion, []
    robots = _read(recording)
    for robot in robots:
        column = motion.robots.index(robot.uuid)
        for report in robot.reports:
            for t_s, x_m, y_m, _ in report.path[:3].tolist():
                if t_s < motion.end_s:
                    sample = motion.sample(t_s)
                    errors_m.append(np.hypot(motion.x_m[sample, column] - x_m, motion.y_m[sample, column] - y_m))
    assert len(errors_m) > 500
    assert np.quantile(errors_m, 0.9) < 0.5


def _read(recording: Recording) -> list[Robot]:
    stamped = [f'{{"received":"2026-09-21T14:13:20Z","message":{line.message}}}'.encode() for line in recording.lines]
    return robots_of_lines(stamped)


def test_paths_and_states_follow_the_vendors_habits() -> None:
    vendors = (Habits("Alder", 5, path_s=2, tells_waiting=True), Habits("Birch", 5, path_s=0), Habits("Corvid", 5))
    recording = simulate(replace(BLIND, vendors=vendors, seconds=40.0))
    messages = [json.loads(line.message) for line in recording.lines]
    identities = [message for message in messages if "manufacturerName" in message]
    vendor_of = {identity["uuid"]: identity["manufacturerName"] for identity in identities}
    points: dict[str, set[int]] = {"Alder": set(), "Birch": set(), "Corvid": set()}
    states: dict[str, set[str]] = {"Alder": set(), "Birch": set(), "Corvid": set()}
    for message in messages:
        if "location" in message:
            points[vendor_of[message["uuid"]]].add(len(message.get("path", [])))
            states[vendor_of[message["uuid"]]].add(message["operationalState"])
    assert points == {"Alder": {2}, "Birch": {0}, "Corvid": {10}}
    assert "waitingExternalEvent" in states["Alder"]
    assert states["Birch"] == states["Corvid"] == {"navigating"}


def test_a_swerving_robot_leaves_its_path_and_returns() -> None:
    recording = simulate(SWERVING)
    swerved = [stop for stop in recording.truth.stops if stop.aside_m > 0.35]
    assert swerved
    for stop in swerved:
        off_m = _off_way_m(recording.truth.motion, stop)
        assert off_m.max() > 0.3
        assert off_m.min() < 0.1


def _off_way_m(motion: Motion, stop: Stop) -> Floats:
    """How far the robot is beside the middle of the cells that it drives along, from the stop to 20 s after it."""
    column = motion.robots.index(stop.robot)
    during = slice(motion.sample(stop.start_s), motion.sample(stop.end_s + 20.0))
    along_x = np.abs(np.cos(motion.yaw_rad[during, column])) > 0.7
    across_m = np.where(along_x, motion.y_m[during, column], motion.x_m[during, column])
    return np.abs((across_m / CELL_M + 0.5) % 1 - 0.5) * CELL_M


def test_silent_robots_send_nothing_and_are_there_or_gone() -> None:
    recording = simulate(replace(BLIND, silences_per_hour=60.0, seconds=120.0))
    motion, silences = recording.truth.motion, recording.truth.silences
    gone = [silence for silence in silences if silence.gone_s is not None and silence.gone_s + 1 < motion.end_s]
    there = [silence for silence in silences if silence.gone_s is None]
    assert gone
    assert there
    for silence in silences:
        column = motion.robots.index(silence.robot)
        sent_s = [report.t_s for robot in _read(recording) if robot.uuid == silence.robot for report in robot.reports]
        assert not any(silence.start_s < t_s < silence.end_s for t_s in sent_s)
        last = motion.sample(min(silence.end_s, motion.end_s) - 0.2)
        assert np.isnan(motion.x_m[last, column]) == (silence in gone)


def test_the_truth_is_read_back_as_it_was_written(blind: Recording, tmp_path: Path) -> None:
    blind.save(tmp_path, {})
    robots = robots_in_file(tmp_path / LOG)
    truth = load(tmp_path, reported_motion(robots))
    assert [stop.pair for stop in truth.stops] == [stop.pair for stop in blind.truth.stops]
    assert truth.motion.x_m == pytest.approx(blind.truth.motion.x_m, abs=1e-4, nan_ok=True)
    assert {robot.uuid for robot in robots} == set(truth.motion.robots)


def test_reported_positions_are_the_true_ones(blind: Recording) -> None:
    motion = blind.truth.motion
    for robot in _read(blind):
        column = motion.robots.index(robot.uuid)
        for report in robot.reports:
            sample = motion.sample(report.t_s)
            assert report.x_m == pytest.approx(motion.x_m[sample, column], abs=1e-3)
