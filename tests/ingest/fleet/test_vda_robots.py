"""Robots of VDA 5050 in the fleet, beside others."""

import json
from typing import Any

import pytest

from ingest.batch import Basis
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.robot import Robot
from ingest.languages.tolerance.heard import RESTARTED, RESTARTED_S
from ingest.languages.vda5050.vda_memory import VdaMemory
from ingest.settings import Datum, Vendor
from tests.helpers.saying import HALL, status
from tests.helpers.vda_saying import (
    MAKER,
    MAP,
    factsheet,
    line,
    node,
    order,
    state,
    state_3,
    under_way,
    vda,
    visualization,
)
from tests.ingest.fleet.made_fleet import LINE, NOW_S, counted, fleet

NODES = [node(0, 0.0), node(1, 10.0), node(2, 10.0, 8.0)]


def floor_of(*vendors: Vendor) -> Fleet:
    return fleet(*vendors, datums=(Datum(id=MAP, name="Hall"), Datum(id=HALL, name="Other hall")))


def tell(of: Fleet, kind: str, raw: bytes, t_s: float, serial: str = "0001") -> str | None:
    return of.receive(raw, t_s, line(kind, serial))


def on_its_way(of: Fleet) -> Robot:
    """A robot with an order, one metre behind its first node."""
    tell(of, "order", order(NOW_S, NODES), NOW_S)
    tell(of, "state", under_way(NOW_S + 1, 1.0, 0.0, NODES[1:]), NOW_S + 1)
    (robot,) = of.robots.values()
    return robot


def test_a_robot_has_the_name_of_its_topic_and_a_forecast_by_its_order() -> None:
    of = floor_of()
    robot = on_its_way(of)
    assert (robot.vendor, robot.name, robot.language) == (MAKER, "KIT 0001", "vda5050")
    assert robot.forecast is not None
    assert robot.forecast.basis is Basis.ORDER
    assert robot.forecast.knots[1][:3] == pytest.approx((NOW_S + 10, 10.0, 0.0))
    batch = of.next_batch(NOW_S + 2)
    assert (batch.names, batch.basis.tolist()) == (("KIT 0001",), [Basis.ORDER])


def test_the_vendor_of_a_manufacturer_in_the_site_file_is_the_robots_vendor() -> None:
    of = floor_of(Vendor(name="Alder", manufacturers=("kit",)))
    assert on_its_way(of).vendor == "Alder"


def test_a_factsheet_that_comes_late_gives_size_and_speed() -> None:
    of = floor_of()
    robot = on_its_way(of)
    assert counted(of, "deviations_total")[MAKER, "identity-missing"] == 1
    tell(of, "factsheet", factsheet(NOW_S + 2), NOW_S + 2)
    assert robot.forecast is not None
    assert (robot.forecast.length_m, robot.forecast.width_m) == (1.2, 0.8)
    assert (robot.model, robot.name) == ("Carrier", "KIT 0001")


def test_a_path_without_times_is_followed_by_a_robot_that_is_about_to_drive() -> None:
    of = floor_of()
    path = {"polyline": [{"x": float(x), "y": 0.0} for x in range(1, 5)]}
    still = {"vx": 0.0, "vy": 0.0, "omega": 0.0}
    tell(of, "state", state_3(NOW_S, intermediatePath=path, driving=True, velocity=still), NOW_S)
    (robot,) = of.robots.values()
    assert robot.forecast is not None
    t_s, x_m, _, _ = robot.forecast.knots[4]
    assert (t_s - NOW_S, x_m) == pytest.approx((4.5, 4.0))


def test_an_order_changes_the_forecast_without_a_new_pose() -> None:
    of = floor_of()
    robot = on_its_way(of)
    of.next_batch(NOW_S + 2)
    tell(of, "order", order(NOW_S + 3, [NODES[2], node(3, 30.0, 8.0)], orderUpdateId=1), NOW_S + 3)
    assert len(of.next_batch(NOW_S + 4)) == 1
    assert robot.forecast is not None
    assert robot.forecast.knots[-1][1:3] == (30.0, 8.0)


def test_a_message_that_comes_from_a_second_broker_changes_nothing() -> None:
    of = floor_of()
    robot = on_its_way(of)
    of.next_batch(NOW_S + 2)
    again = under_way(NOW_S + 1, 1.0, 0.0, NODES[1:])
    assert of.receive(again, NOW_S + 3, line("state", number=2)) is None
    assert len(of.next_batch(NOW_S + 4)) == 0
    assert robot.deviations["message-repeated"] == 1


def test_rules_of_other_languages_are_not_counted() -> None:
    """MassRobotics allows one status a second, VDA 5050 any number."""
    of = floor_of()
    on_its_way(of)
    for step in range(1, 5):
        t_s = NOW_S + 1 + step / 10
        tell(of, "visualization", visualization(t_s, 1.0 + step / 10, 0.0), t_s)
    assert not [rule for _, rule in counted(of, "deviations_total") if rule == "status-too-frequent"]


def test_a_load_widens_the_envelope_while_it_is_carried() -> None:
    of = floor_of()
    tell(of, "factsheet", factsheet(NOW_S), NOW_S)
    box = {"boundingBoxReference": {"x": 0.0, "y": 0.0, "z": 0.2}, "loadDimensions": {"length": 2.0, "width": 1.4}}
    loads: list[tuple[list[Any], float]] = [([], 1.2), ([box], 2.0), ([], 1.2)]
    for step, (carried, length_m) in enumerate(loads):
        tell(of, "state", state(NOW_S + step, loads=carried), NOW_S + step)
        (robot,) = of.robots.values()
        assert robot.forecast is not None
        assert robot.forecast.length_m == length_m


@pytest.mark.parametrize(
    ("keys", "doubt_m"),
    [({"positionInitialized": False}, 1.0), ({"deviationRange": 0.4}, 0.4), ({"deviationRange": 40.0}, 1.0)],
)
def test_how_far_a_position_may_be_off(keys: dict[str, Any], doubt_m: float) -> None:
    of = floor_of()
    place = {"x": 0.0, "y": 0.0, "theta": 0.0, "mapId": MAP, "positionInitialized": True}
    tell(of, "state", state(NOW_S, agvPosition=place | keys), NOW_S)
    (robot,) = of.robots.values()
    assert robot.doubt_m == doubt_m


@pytest.mark.parametrize(("driving", "too_rare"), [(False, 0), (True, 1)])
def test_a_standing_robot_may_send_a_state_each_30_seconds(driving: bool, too_rare: int) -> None:
    of = floor_of()
    place = {"x": 0.0, "y": 0.0, "theta": 0.0, "mapId": MAP, "positionInitialized": True}
    for t_s in (NOW_S, NOW_S + 31.0):
        tell(of, "state", state(t_s, driving=driving, agvPosition=place), t_s)
    assert counted(of, "deviations_total").get((MAKER, "status-too-rare"), 0) == too_rare


def test_a_robot_in_an_emergency_stop_stands_whatever_its_order() -> None:
    of = floor_of()
    robot = on_its_way(of)
    stopped = under_way(NOW_S + 2, 2.0, 0.0, NODES[1:], safetyState={"eStop": "MANUAL", "fieldViolation": False})
    tell(of, "state", stopped, NOW_S + 2)
    assert robot.forecast is not None
    assert robot.forecast.basis is Basis.STATIONARY


@pytest.mark.parametrize("stamp", ["soon", {}, float("nan"), "1960-01-01T00:00:00Z"])
def test_a_robot_whose_timestamps_can_not_be_read_is_where_it_says_as_of_their_arrival(stamp: Any) -> None:
    of = floor_of()
    robot = on_its_way(of)
    for second in (2.0, 3.0):
        raw = under_way(NOW_S, second, 0.0, NODES[1:], timestamp=stamp, headerId=None)
        assert tell(of, "state", raw, NOW_S + second) is None
        assert robot.seen is not None
        assert robot.forecast is not None
        assert (robot.seen.t_s, robot.seen.x_m) == (NOW_S + second, second)
        assert robot.forecast.basis is Basis.ORDER
        assert robot.forecast.knots[1][:3] == pytest.approx((NOW_S + 10, 10.0, 0.0))
    tell(of, "state", under_way(NOW_S + 4, 4.0, 0.0, NODES[1:]), NOW_S + 4)
    assert robot.seen is not None
    assert (robot.seen.t_s, robot.seen.x_m, robot.clock.offset_s) == (NOW_S + 4, 4.0, 0.0)


def test_documents_name_the_language_and_show_what_was_sent() -> None:
    of = floor_of()
    robot = on_its_way(of)
    tell(of, "factsheet", factsheet(NOW_S + 2), NOW_S + 2)
    of.receive(status("A-1", NOW_S), NOW_S, LINE)
    document = fleet_report.robot_document(of, robot, NOW_S + 2)
    json.dumps(document, allow_nan=False)
    assert (document["language"], document["forecast"]["basis"]) == ("vda5050", "order")
    assert document["status"]["lastNodeId"] == "n0"
    assert document["identity"]["typeSpecification"]["seriesName"] == "Carrier"
    fleet_report.measure(of, NOW_S + 2)
    assert counted(of, "robots_by_language") == {(MAKER, "vda5050"): 1, ("unknown", "massrobotics"): 1}


def test_other_settings_forecast_the_robot_again() -> None:
    of = floor_of()
    robot = on_its_way(of)
    of.reconfigure(
        of.owners.vendors, of.placement._frames, of.reading.model_copy(update={"horizon_s": 2.0, "quiet_after_s": 0.1})
    )
    assert robot.forecast is not None
    assert len(robot.forecast.knots) == 2


def test_an_unreadable_topic_and_a_broken_message_are_rejected_and_leave_the_robot_alone() -> None:
    of = floor_of()
    robot = on_its_way(of)
    memory = robot.memory
    assert tell(of, "instantActions", vda(NOW_S + 2), NOW_S + 2) == "topic-unknown"
    assert tell(of, "state", b"{", NOW_S + 2) == "not-json"
    assert counted(of, "rejections_total")[MAKER, "not-json"] == 1
    assert robot.memory is memory


def test_an_outline_in_the_factsheet_is_the_shape_of_the_forecast_also_with_a_load() -> None:
    of = floor_of()
    corners = [{"x": x, "y": y} for x, y in ((0.8, 0.0), (-0.4, 0.4), (-0.4, -0.4))]
    tell(
        of, "factsheet", factsheet(NOW_S, agvGeometry={"envelopes2d": [{"set": "a", "polygonPoints": corners}]}), NOW_S
    )
    tell(of, "state", state(NOW_S), NOW_S)
    (robot,) = of.robots.values()
    assert robot.forecast is not None
    assert robot.forecast.shape is not None
    assert len(robot.forecast.shape.parts) == 1
    assert robot.forecast.knots[0][1:3] == pytest.approx((0.2, 0.0))
    box = {"boundingBoxReference": {"x": -1.0, "y": 0.0, "z": 0.2}, "loadDimensions": {"length": 1.0, "width": 0.5}}
    tell(of, "state", state(NOW_S + 1, loads=[box]), NOW_S + 1)
    assert robot.forecast.shape is not None
    assert len(robot.forecast.shape.parts) == 2
    assert robot.forecast.length_m == pytest.approx(2.3)


def test_a_robot_is_placed_after_one_stamp_too_far_ahead() -> None:
    of = floor_of()
    tell(of, "state", state(NOW_S + 3600.0, headerId=1), NOW_S)
    for step in range(1, 6):
        tell(of, "state", state(NOW_S + step, float(step), headerId=1 + step, driving=True), NOW_S + step)
    (robot,) = of.robots.values()
    assert robot.seen is not None
    assert (robot.seen.x_m, robot.seen.t_s) == (5.0, NOW_S + 5)


@pytest.mark.parametrize("every_s", [0.0, 0.001, 0.2, 0.5])
def test_old_messages_that_a_second_broker_kept_back_are_no_restart(every_s: float) -> None:
    of, old = floor_of(), [node(0, 0.0), node(1, 0.0, 50.0)]
    tell(of, "order", order(NOW_S, NODES, orderId="new", headerId=500), NOW_S)
    tell(of, "state", under_way(NOW_S, 0.0, 0.0, NODES[1:], orderId="new", headerId=1000), NOW_S)
    for count in range(40):
        arrival_s, sent_s = NOW_S + 0.5 + every_s * count, NOW_S - 100 + count
        tell(of, "order", order(sent_s, old, orderId=f"old {count}", headerId=400 + count), arrival_s)
        tell(of, "state", under_way(sent_s, -50.0, 0.0, old[1:], orderId="old", headerId=900 + count), arrival_s)
    (robot,) = of.robots.values()
    assert isinstance(robot.memory, VdaMemory)
    assert robot.memory.state is not None
    assert (robot.memory.state.order_id, [each.order_id for each in robot.memory.orders]) == ("new", ["new"])
    assert robot.deviations["message-reordered"] == 80


@pytest.mark.parametrize(("every_s", "after"), [(0.125, 1 + int(RESTARTED_S / 0.125)), (1.0, RESTARTED)])
def test_a_robot_that_counts_anew_with_an_older_clock_is_heard_once_it_has_sent_for_a_while(
    every_s: float, after: int
) -> None:
    of, is_heard = floor_of(), []
    tell(of, "state", state(NOW_S, 0.0, headerId=5000), NOW_S)
    (robot,) = of.robots.values()
    for count in range(1, 61):
        raw = state(NOW_S - 3600 + every_s * count, 1.0 * count, headerId=count)
        tell(of, "state", raw, NOW_S + every_s * count)
        assert isinstance(robot.memory, VdaMemory)
        is_heard.append(robot.memory.heard["state"].header_id == count)
    assert is_heard == [count >= after for count in range(1, 61)]


@pytest.mark.parametrize("counts", [0, 1])
def test_a_robot_whose_clock_stands_is_placed_as_of_arrival(counts: int) -> None:
    of = floor_of()
    for step in range(30):
        raw = state(NOW_S, step / 10, driving=True, headerId=counts * step, timestamp="1970-01-01T00:00:00.000Z")
        tell(of, "state", raw, NOW_S + step)
    (robot,) = of.robots.values()
    assert robot.seen is not None
    assert (robot.seen.x_m, robot.seen.t_s) == (2.9, NOW_S + 29)
    assert robot.deviations["stamp-unchanged"] == (27 if counts else 29)


@pytest.mark.parametrize("spelling", ["the same", "another"])
def test_a_parked_robot_that_repeats_its_state_with_clock_and_counter_standing_stays_heard(spelling: str) -> None:
    of = floor_of()
    for t_s in range(0, 600, 20):
        raw = state(NOW_S, 3.0, headerId=1)
        written = raw.replace(b": ", b":") if spelling == "another" and t_s % 40 else raw
        tell(of, "state", written, NOW_S + t_s)
        of.next_batch(NOW_S + t_s + 1)
    (robot,) = of.robots.values()
    assert robot.seen is not None
    assert (robot.arrival_s, robot.seen.x_m) == (NOW_S + 580, 3.0)


def test_a_state_that_is_repeated_does_not_put_a_robot_back_that_visualizations_show_elsewhere() -> None:
    of = floor_of()
    for t_s in range(0, 200, 5):
        tell(of, "state", state(NOW_S, 3.0, headerId=1), NOW_S + t_s)
        tell(of, "visualization", visualization(NOW_S + t_s + 1, 3.0 + t_s, 0.0), NOW_S + t_s + 1)
    (robot,) = of.robots.values()
    tell(of, "state", state(NOW_S, 3.0, headerId=1), NOW_S + 200)
    assert robot.seen is not None
    assert robot.seen.x_m == 198.0
