"""What a robot does, and where it is, by its newest state."""

from math import isnan, pi
from typing import Any

import pytest

from ingest.batch import Basis
from ingest.languages.model import Status
from ingest.languages.timestamps import write
from ingest.sizes.size_limit import Rectangle
from ingest.sizes.stated_loads import NO_LOADS, LoadBox, read_loads
from tests.helpers.vda_saying import node, node_states, order, position, state, state_3, under_way, vda, visualization
from tests.ingest.languages.vda5050.made_vda import Listener, T

RUNNING = [{"actionId": "a", "actionStatus": "RUNNING"}]
AHEAD = node_states([node(1, 4.0)])


def status(**keys: Any) -> Status:
    return Listener().status_after(("state", state(T, **keys)))


def status_3(**keys: Any) -> Status:
    return Listener().status_after(("state", state_3(T, **keys)))


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({}, "idle"),
        ({"driving": True}, "navigating"),
        ({"driving": None, "velocity": {"vx": 0.5}}, "navigating"),
        ({"driving": None, "velocity": {}}, "idle"),
        ({"nodeStates": AHEAD}, "navigating"),
        ({"nodeStates": AHEAD, "paused": True}, "waitingExternalEvent"),
        ({"nodeStates": AHEAD, "actionStates": RUNNING}, "waitingInternalEvent"),
        ({"nodeStates": AHEAD, "driving": True, "actionStates": RUNNING}, "navigating"),
        ({"nodeStates": node_states([node(1, 4.0, released=False)])}, "waitingExternalEvent"),
        ({"newBaseRequest": True}, "waitingExternalEvent"),
        ({"newBaseRequest": True, "driving": True}, "navigating"),
        ({"zoneRequests": [{"requestStatus": "REQUESTED"}]}, "waitingExternalEvent"),
        ({"edgeRequests": [{"requestStatus": "GRANTED"}]}, "idle"),
        ({"batteryState": {"batteryCharge": 9.0, "charging": True}}, "charging"),
        ({"batteryState": {"batteryCharge": 9.0, "charging": True}, "driving": True}, "navigating"),
        ({"operatingMode": "MANUAL"}, "manualOverride"),
        ({"operatingMode": "SERVICE"}, "disabled"),
        ({"operatingMode": "TEACHIN", "velocity": {"vx": 0.3}}, "manualOverride"),
        ({"operatingMode": "SEMIAUTOMATIC", "driving": True}, "navigating"),
    ],
)
def test_the_state_is_the_nearest_of_the_states_that_all_languages_share(keys: dict[str, Any], expected: str) -> None:
    assert status(**keys).state == expected


@pytest.mark.parametrize(
    ("connection", "expected"),
    [("ONLINE", "idle"), ("OFFLINE", "offline"), ("HIBERNATING", "offline"), ("CONNECTIONBROKEN", "idle")],
)
def test_a_robot_that_signs_off_is_offline_and_one_that_is_cut_off_keeps_its_state(
    connection: str, expected: str
) -> None:
    goodbye = ("connection", vda(T + 1, connectionState=connection))
    assert Listener().status_after(("state", state(T)), goodbye).state == expected
    assert Listener().status_after(("state", state(T)), goodbye, ("state", state(T + 2))).state == "idle"


def test_a_robot_whose_poses_go_on_after_its_goodbye_is_online() -> None:
    goodbye = ("connection", vda(T + 1, connectionState="OFFLINE"))
    listener = Listener()
    assert listener.status_after(("state", state(T)), goodbye).state == "offline"
    assert listener.status_after(("visualization", visualization(T + 0.5, 1.0, 0.0))).state == "offline"
    assert listener.status_after(("visualization", visualization(T + 2, 1.0, 0.0))).state == "idle"
    unstamped = visualization(T, 1.0, 0.0, timestamp="soon")
    assert Listener().status_after(("state", state(T)), goodbye, ("visualization", unstamped)).state == "idle"


@pytest.mark.parametrize(("ordered", "expected"), [(None, True), (True, True), (False, False), ("absent", True)])
def test_a_node_is_released_unless_the_state_or_the_order_says_otherwise(ordered: Any, expected: bool) -> None:
    nodes = [node(0, 0.0), node(1, 4.0, released=ordered is not False)]
    if ordered == "absent":
        nodes = [{key: each[key] for key in each if key != "released"} for each in nodes]
    ahead = [{"nodeId": "n1", "sequenceId": 2}]
    messages = [] if ordered is None else [("order", order(T - 1, nodes, []))]
    report = state(T, orderId="o1", lastNodeId="n0", nodeStates=ahead)
    read = Listener().status_after(*messages, ("state", report))
    assert (read.state == "navigating") == expected
    assert "key-absent" in read.findings
    assert read.oddities[0].path == "nodeStates[0].released"


@pytest.mark.parametrize("numbers", [(0, 2), (1, 2), (4, 6)])
def test_a_robot_that_stands_goes_on_to_nodes_that_its_states_number_otherwise_than_the_order(
    numbers: tuple[int, int],
) -> None:
    nodes = [node(number, 4.0 * number) for number in range(4)]
    ahead = [{**each, "sequenceId": number} for each, number in zip(nodes[2:], numbers, strict=True)]
    report = under_way(T, 4.0, 0.0, nodes[2:], driving=False, nodeStates=node_states(ahead))
    read = Listener().status_after(("order", order(T - 1, nodes)), ("state", report))
    assert (read.state, read.path_basis) == ("navigating", Basis.ORDER)
    assert [row[1] for row in read.path.poses] == [8.0, 12.0]


def test_nodes_that_the_order_lacks_are_ahead_whatever_their_numbers_are() -> None:
    nodes = [node(number, 4.0 * number) for number in range(4)]
    unseen = [node(0, 9.0, nodeId="m0"), node(1, 9.0, 3.0, nodeId="m1")]
    for driving in (False, True):
        report = under_way(T, 4.0, 0.0, nodes[2:], driving=driving, nodeStates=unseen)
        read = Listener().status_after(("order", order(T - 1, nodes)), ("state", report))
        assert (read.state, read.path.poses[-1][1:3]) == ("navigating", (9.0, 3.0))


def test_a_retained_goodbye_does_not_outlive_newer_states() -> None:
    listener = Listener()
    old = ("connection", vda(T - 60, connectionState="OFFLINE"))
    assert listener.status_after(("state", state(T)), old).state == "idle"


@pytest.mark.parametrize(
    "keys",
    [
        {"safetyState": {"eStop": "MANUAL", "fieldViolation": False}},
        {"safetyState": {"activeEmergencyStop": "REMOTE"}},
        {"safetyState": {"eStop": "NONE", "fieldViolation": True}},
        {"errors": [{"errorType": "x", "errorLevel": "FATAL"}]},
        {"errors": [{"errorType": "x", "errorLevel": "CRITICAL"}]},
    ],
)
def test_a_robot_that_can_not_go_on_is_blocked(keys: dict[str, Any]) -> None:
    assert status(**keys).is_blocked


HINDRANCES: tuple[dict[str, Any], ...] = (
    {"safetyState": {"eStop": "NONE", "fieldViolation": True}},
    {"safetyState": {"eStop": "SOMETHING", "fieldViolation": False}},
    {"errors": [{"errorType": "e", "errorLevel": "FATAL"}]},
    {"errors": [{"errorType": "e", "errorLevel": "critical"}]},
    {"errors": [{"errorType": "e", "errorLevel": "GHASTLY"}]},
    {"operatingMode": "SUPERVISED"},
)


@pytest.mark.parametrize("keys", HINDRANCES)
def test_what_hinders_a_robot_that_stands_hinders_none_that_drives(keys: dict[str, Any]) -> None:
    assert status(**keys).is_blocked
    assert status(**keys, velocity={"vx": 0.05}).is_blocked
    for driving in ({"driving": True}, {"velocity": {"vx": -0.2}}, {"velocity": {"vx": 0.1, "vy": 0.1}}):
        read = status(**keys, **driving)
        assert (read.is_blocked, read.state) == (False, "navigating")


def test_an_emergency_stop_is_believed_until_the_robot_moves() -> None:
    stop = {"safetyState": {"eStop": "manual", "fieldViolation": False}}
    assert status(**stop, driving=True).is_blocked
    assert not status(**stop, driving=True, velocity={"vx": 0.2}).is_blocked


@pytest.mark.parametrize("stop", ["none", "None", "NONE ", "no-ne", False, 0])
def test_no_stop_is_none_however_it_is_spelt(stop: Any) -> None:
    assert not status(safetyState={"eStop": stop, "fieldViolation": False}).is_blocked


@pytest.mark.parametrize(
    ("mode", "expected"),
    [("manual", "manualOverride"), ("teach-in", "disabled"), ("Semi Automatic", "idle"), ("?", "idle")],
)
def test_a_mode_is_read_in_any_spelling(mode: str, expected: str) -> None:
    read = status(operatingMode=mode)
    assert read.state == expected
    assert read.oddities[0].path == "operatingMode"


def test_a_warning_blocks_nothing() -> None:
    read = status(errors=[{"errorType": "lowBattery", "errorLevel": "WARNING"}])
    assert (read.is_blocked, read.error_codes) == (False, ("lowBattery",))


def test_a_robot_that_does_not_know_where_it_is_is_lost() -> None:
    assert not status().is_lost
    assert status(agvPosition=position(positionInitialized=False)).is_lost
    assert status(agvPosition=position(positionInitialized=None, localized=False)).is_lost


def test_pose_motion_and_amounts() -> None:
    read = status(agvPosition=position(1.0, 2.0, pi / 2, deviationRange=0.3), velocity={"vx": -0.5, "omega": 0.1})
    assert (read.x, read.y, read.yaw_rad, read.datum) == (1.0, 2.0, pi / 2, "hall")
    assert (read.linear_mps, read.turn_rad_per_s, read.deviation_m) == (-0.5, 0.1, 0.3)
    assert read.amounts.battery_pct == 80.0
    assert status_3().amounts.battery_pct == 80.0


def test_no_load_one_that_is_not_described_and_several_boxes() -> None:
    assert isnan(status().amounts.load_used_pct)
    assert status(loads=[]).amounts.load_used_pct == 0.0
    assert (status(loads=[{"loadId": "a"}]).loads, status(loads=[{}]).amounts.load_used_pct) == ((), 100.0)
    behind = {"x": -1.0, "y": 0.0, "z": 0.4}, {"length": 1.2, "width": 0.8, "height": 1.0}
    across = {"x": 0.5, "y": 0.0, "z": 0.0, "theta": pi / 2}, {"length": 1.0, "width": 0.2}
    boxes = [{"boundingBoxReference": at, "loadDimensions": size} for at, size in (behind, across)]
    robot = Rectangle.about((0.0, 0.0), 1.0, 1.0)
    assert read_loads(status(loads=boxes).loads, robot, robot, 30.0).box == pytest.approx(
        LoadBox(-1.6, 0.6, -0.5, 0.5, 1.4)
    )
    flat = {"boundingBoxReference": behind[0], "loadDimensions": {"length": 1.2, "width": 1e-200}}
    assert read_loads(status(loads=[flat]).loads, robot, robot, 30.0) == NO_LOADS


def test_a_robot_that_plans_by_itself_has_its_own_path() -> None:
    polyline = [{"x": 1.0, "y": 0.0, "eta": write(T + 1)}, {"x": 3.0, "y": 1.0, "eta": write(T + 3), "theta": 0.5}]
    curve = {"trajectory": {"controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 9.0, "y": 9.0}]}}
    read = status_3(driving=True, intermediatePath={"polyline": polyline}, plannedPath=curve)
    assert [row[:3] for row in read.path.poses[:2]] == [(T + 1, 1.0, 0.0), (T + 3, 3.0, 1.0)]
    assert read.path_basis is Basis.PATH
    assert read.destinations.poses[0][1:3] == (9.0, 9.0)


def test_what_a_position_lacks_is_named_by_the_key_of_its_version() -> None:
    assert [each.path for each in status(agvPosition={"x": 0.0, "y": 0.0}).oddities] == [
        "agvPosition.theta",
        "agvPosition.mapId",
    ]
    place = {"x": 0.0, "y": 0.0, "localized": True}
    assert status_3(mobileRobotPosition=place).oddities[0].path == "mobileRobotPosition.theta"
    named = Listener().hears("state", state_3(T, mobileRobotPosition=None))
    assert [each.path for each in named.oddities] == ["mobileRobotPosition"]
