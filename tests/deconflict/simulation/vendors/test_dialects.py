"""Each vendor's bytes are what its dialect claims, and the bundled site reads them right."""

import json
import re
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np
import pytest

from deconflict.settings import site_file
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.fleet_plans import FleetPlan
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import MAKES, VendorName, participants
from deconflict.simulation.robot_state import RobotState, robot_states
from deconflict.simulation.vendors.dialects import DIALECTS, SITE_MAPS
from ingest.frames.frame_registry import FrameRegistry
from ingest.languages.massrobotics.parser import read
from ingest.languages.model import Identity, Status

NOW_S = 1_795_000_000.37
SAMPLE_FINDINGS = {
    "uuid-upper-case",
    "stamp-offset-no-colon",
    "stamp-whole-seconds",
    "datum-upper-case",
    "datum-key",
    "path-too-far",
    "angle-not-unit",
}


@pytest.fixture(scope="module")
def states() -> list[RobotState]:
    """Everybody's state at several moments of two minutes."""
    world = World(layout_for(24), participants(24), np.random.default_rng(1))
    found: list[RobotState] = []
    for _ in range(12):
        for _ in range(100):
            world.step(0.1)
        found += robot_states(world, np.arange(len(world)))
    return found


def of(robots: list[RobotState], vendor: VendorName, *, moving: bool = False) -> list[RobotState]:
    mine = [state for state in robots if state.member.make.vendor is vendor]
    return [state for state in mine if state.state == "navigating" and state.linear_mps > 0.3] if moving else mine


def status(robot: RobotState) -> dict[str, Any]:
    return json.loads(DIALECTS[robot.member.make.vendor].messages(robot, NOW_S)[-1])


def seconds(stamp: str) -> float:
    return datetime.fromisoformat(stamp).timestamp()


def test_every_message_of_every_vendor_is_accepted(states: list[RobotState]) -> None:
    for robot in states:
        first, second = DIALECTS[robot.member.make.vendor].messages(robot, NOW_S, introduce=True)
        identity, now = read(first), read(second)
        assert isinstance(identity, Identity)
        assert isinstance(now, Status)
        assert identity.uuid == now.uuid == robot.member.uuid
        assert identity.manufacturer == robot.member.make.vendor
        assert now.known_state


@pytest.mark.parametrize("vendor", [VendorName.ALDER, VendorName.BASALT, VendorName.WALKERS])
def test_three_vendors_keep_to_the_standard(states: list[RobotState], vendor: VendorName) -> None:
    for robot in of(states, vendor):
        for message in DIALECTS[vendor].messages(robot, NOW_S, introduce=True):
            reading = read(message)
            assert reading.findings == ()


def test_all_timestamps_of_alder_are_three_seconds_fast(states: list[RobotState]) -> None:
    for robot in of(states, VendorName.ALDER, moving=True):
        document = status(robot)
        assert seconds(document["timestamp"]) == pytest.approx(NOW_S + 3.0, abs=1e-3)
        after_s = [seconds(point["timestamp"]) - NOW_S - 3.0 for point in document["path"]]
        assert after_s == pytest.approx(range(1, 11), abs=2e-3)
        planned, _ = robot.plan.at(np.arange(1.0, 11.0))
        assert np.array([(point["x"], point["y"]) for point in document["path"]]) == pytest.approx(
            planned[:, :2], abs=1e-3
        )


def test_corvid_sends_like_the_sample_sender(states: list[RobotState]) -> None:
    for robot in of(states, VendorName.CORVID, moving=True):
        document = status(robot)
        assert document["uuid"] == robot.member.uuid.upper()
        assert document["location"]["planarDatum"] == SITE_MAPS[robot.floor].datum.upper()
        stamps = [document["timestamp"], *(point["timestamp"] for point in document["path"])]
        assert all(re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+0000", stamp) for stamp in stamps)
        after_s = [seconds(stamp) - seconds(stamps[0]) for stamp in stamps[1:]]
        assert after_s == [2.0 * second for second in range(1, 11)]
        assert all("planarDatum" in point and "planarDatumUUID" not in point for point in document["path"])
        planned, _ = robot.plan.at(np.array(after_s) + np.floor(NOW_S) - NOW_S)
        assert np.array([(point["x"], point["y"]) for point in document["path"]]) == pytest.approx(
            planned[:, :2], abs=1e-3
        )
        reading = read(json.dumps(document).encode())
        assert set(reading.findings) <= SAMPLE_FINDINGS
        assert {"uuid-upper-case", "stamp-offset-no-colon", "datum-key", "path-too-far"} <= set(reading.findings)


def test_the_maps_of_the_bundled_site_put_basalts_robots_at_their_true_positions(states: list[RobotState]) -> None:
    bundled = site_file.load(demo_site())
    frames = FrameRegistry(bundled.datums, bundled.vendors)
    for robot in of(states, VendorName.BASALT):
        reading = read(DIALECTS[VendorName.BASALT].messages(robot, NOW_S)[-1])
        assert isinstance(reading, Status)
        frame = frames.frame("Basalt", reading.datum)
        x, y, yaw = frame.pose(reading.x, reading.y, reading.yaw_rad)
        assert frame.floor == SITE_MAPS[robot.floor].datum
        assert np.hypot(x - robot.x_m, y - robot.y_m) < 0.02
        assert np.cos(yaw - robot.yaw_rad) > np.cos(0.002)
        assert np.hypot(reading.x - robot.x_m, reading.y - robot.y_m) > 10.0


def test_few_people_report_a_path_but_all_report_a_speed(states: list[RobotState]) -> None:
    walking = of(states, VendorName.WALKERS, moving=True)
    with_path = [robot for robot in walking if "path" in status(robot)]
    assert 0 < len(with_path) < len(walking) / 2
    for robot in walking:
        assert status(robot)["velocity"]["linear"] == pytest.approx(robot.linear_mps, abs=1e-3)


@pytest.mark.parametrize("vendor", [VendorName.ALDER, VendorName.BASALT])
def test_a_path_to_the_other_floor_names_its_datum(states: list[RobotState], vendor: VendorName) -> None:
    below = next(robot for robot in of(states, vendor, moving=True) if robot.floor == 0)
    plan = FleetPlan(np.array([0.0, 4.5]), np.array([[9.0, 8.0, 0.0], [3.0, 2.0, 1.0]]), np.array([0, 1]))
    path = status(replace(below, plan=plan))["path"]
    above = DIALECTS[vendor].maps[1]
    assert [point.get("planarDatumUUID") for point in path] == 4 * [None] + 6 * [above.datum]
    x, y, _ = above.pose(3.0, 2.0, 1.0)
    assert (path[-1]["x"], path[-1]["y"]) == pytest.approx((x, y), abs=1e-3)


def test_the_bundled_site_knows_every_vendor_and_fits() -> None:
    bundled = site_file.load(demo_site())
    assert not site_file.fit_problems(bundled)
    assert {vendor.name for vendor in bundled.vendors} == set(VendorName)
    assert [datum.id for datum in bundled.datums] == [dialect_map.datum for dialect_map in SITE_MAPS]
    for make in MAKES:
        vendor = next(vendor for vendor in bundled.vendors if vendor.name == make.vendor)
        assert (vendor.participant == "person") == make.person
        model = vendor.models.get(make.model)
        assert ((model.offset_m[0], model.loaded_offset_m) if model else (0.0, None)) == (
            make.body.ahead_m,
            (make.loaded.ahead_m, 0.0) if make.loaded != make.body else None,
        )
        if model and model.loaded_envelope_m:
            assert model.loaded_envelope_m == (make.loaded.length_m, make.loaded.width_m, make.height_m)
        if vendor.default_envelope_m:
            assert vendor.default_envelope_m == (make.body.length_m, make.body.width_m, make.height_m)
