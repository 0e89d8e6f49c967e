import json
from typing import Any

import numpy as np
import pytest

from ingest.batch import Basis
from ingest.fleet import fleet_report
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.frames.floor_index import MOST_UNKNOWN, NOWHERE
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import OTHER
from ingest.port.connection import Connection
from ingest.settings import UNKNOWN, Datum, Model, Reading, Vendor
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL, LOFT, identity, points, robot, stamp, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, counted, document, documents, fleet

NIL = "00000000-0000-0000-0000-000000000000"


def test_a_status_becomes_a_row_of_the_next_batch_and_only_of_that() -> None:
    receiving_fleet = fleet()
    assert receiving_fleet.receive(identity("A-1", NOW_S - 1), NOW_S - 1, LINE) is None
    assert receiving_fleet.receive(status("A-1", NOW_S, 3.0, 4.0), NOW_S + 0.05, LINE) is None
    batch = receiving_fleet.next_batch(NOW_S + 0.1)
    assert (batch.robots, batch.vendors, batch.names) == ((robot("A-1"),), ("Alder",), ("Alder A-1",))
    assert batch.floors == (HALL,)
    assert batch.forecasts.x_m[0] == 3.0
    assert batch.event_s[0] == pytest.approx(NOW_S)
    assert len(receiving_fleet.next_batch(NOW_S + 0.2)) == 0
    assert receiving_fleet.next_batch(NOW_S + 0.3, everything=True).robots == (robot("A-1"),)


def test_changed_settings_place_robots_anew_and_give_them_to_vendors_anew() -> None:
    alder, basalt = Vendor(name="Alder"), Vendor(name="Basalt")
    receiving_fleet = fleet(alder, basalt)
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, Connection(1, vendor="Alder"))
    receiving_fleet.receive(status("A-1", NOW_S, 3.0, 4.0), NOW_S, Connection(1, vendor="Alder"))
    receiving_fleet.receive(status("B-1", NOW_S, 5.0), NOW_S, Connection(2, vendor="Basalt"))
    receiving_fleet.next_batch(NOW_S)
    makers = Vendor(name="Grove", manufacturers=("alder",), default_envelope_m=(2.0, 2.0, 0.0))
    receiving_fleet.reconfigure(
        VendorRegistry((makers,)), FrameRegistry((), ()), Reading(default_envelope_m=(3.0, 3.0, 0.0))
    )
    batch = receiving_fleet.next_batch(NOW_S)
    assert dict(zip(batch.robots, batch.vendors, strict=True)) == {robot("A-1"): "Grove", robot("B-1"): "Basalt"}
    assert sorted(batch.forecasts.length_m) == [1.0, 3.0]
    assert receiving_fleet.receive(status("B-1", NOW_S + 1), NOW_S + 1, Connection(3, vendor="Grove")) is None
    assert document(receiving_fleet, "B-1")["vendor"] == "Grove"
    assert (
        receiving_fleet.receive(status("A-1", NOW_S + 1), NOW_S + 1, Connection(4, vendor="Other"))
        == "uuid-of-another-vendor"
    )


def test_a_vendor_that_stays_is_read_by_its_changed_settings() -> None:
    receiving_fleet = fleet(Vendor(name="Alder"))
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, Connection(1, vendor="Alder"))
    vendors = (Vendor(name="Alder", default_envelope_m=(2.0, 1.5, 0.0)),)
    receiving_fleet.reconfigure(VendorRegistry(vendors), FrameRegistry((), vendors), Reading())
    receiving_fleet.receive(status("A-1", NOW_S + 1), NOW_S + 1, Connection(1, vendor="Alder"))
    assert receiving_fleet.next_batch(NOW_S + 1).forecasts.length_m[0] == 2.0


def test_robots_of_one_kind_share_a_context_until_settings_change() -> None:
    receiving_fleet = fleet()
    for name in ("A-1", "A-2", "B-1"):
        receiving_fleet.receive(identity(name, NOW_S, robotModel=name[0], maxSpeed=1.0 + (name == "B-1")), NOW_S, LINE)
        receiving_fleet.receive(status(name, NOW_S, 1.0, 2.0, path=points((NOW_S + 20, 9.0, 2.0, 0.0))), NOW_S, LINE)
    first, second, other = (receiving_fleet.robots[robot(name)] for name in ("A-1", "A-2", "B-1"))
    assert first.context is second.context is not other.context
    receiving_fleet.reconfigure(
        receiving_fleet.owners.vendors,
        FrameRegistry((Datum(id=HALL, name="Hall"),), ()),
        Reading(horizon_s=5.0, quiet_after_s=3.0),
    )
    assert first.context is second.context
    assert first.context
    assert first.context.reading.horizon_s == 5.0


def test_destinations_come_with_the_robot_by_time_and_each_on_its_floor() -> None:
    receiving_fleet = fleet(datums=(Datum(id=HALL, name="Hall"), Datum(id=LOFT, name="Loft")))
    far, near = points((NOW_S + 600, 1.0, 2.0, 0.0), (NOW_S + 60, 3.0, 4.0, 0.0))
    beyond = points((NOW_S + 1000, 9.0, 9.0, 0.0))
    receiving_fleet.receive(
        status("A-1", NOW_S, destinations=[far | {"planarDatumUUID": LOFT}, near, *beyond]), NOW_S, LINE
    )
    receiving_fleet.receive(status("B-1", NOW_S), NOW_S, LINE)
    receiving_fleet.receive(status("C-1", NOW_S, destinations=[near], operationalState="manualOverride"), NOW_S, LINE)
    batch = receiving_fleet.next_batch(NOW_S)
    destinations = batch.destinations
    assert destinations.start.tolist() == [0, 2, 2, 2]
    assert destinations.t_s.tolist() == pytest.approx([NOW_S + 60, NOW_S + 600])
    assert (destinations.x_m.tolist(), destinations.y_m.tolist()) == ([3.0, 1.0], [4.0, 2.0])
    assert [batch.floors[floor] for floor in destinations.floor] == [HALL, LOFT]


def test_a_robot_is_accepted_before_it_identifies_itself_with_its_vendors_envelope() -> None:
    receiving_fleet = fleet(Vendor(name="Alder", default_envelope_m=(2.0, 1.5, 0.0)))
    line = Connection(1, vendor="Alder")
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, line)
    assert receiving_fleet.next_batch(NOW_S).forecasts.length_m[0] == 2.0
    assert document(receiving_fleet, "A-1")["identified"] is False
    assert counted(receiving_fleet, "deviations_total")["Alder", "identity-missing"] == 1
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, line)
    assert receiving_fleet.next_batch(NOW_S).forecasts.length_m[0] == 1.0
    assert document(receiving_fleet, "A-1")["identified"] is True


def test_identity_may_come_late_and_on_another_connection() -> None:
    receiving_fleet = fleet(Vendor(name="Alder Robotics", manufacturers=("ALDER",)))
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, LINE)
    assert document(receiving_fleet, "A-1")["vendor"] == UNKNOWN
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, Connection(2))
    assert document(receiving_fleet, "A-1")["vendor"] == "Alder Robotics"


def test_made_up_uuids_are_bounded_and_another_vendors_robots_still_come() -> None:
    receiving_fleet = fleet(Vendor(name="Alder"), Vendor(name="Basalt"), max_robots_per_vendor=3, forget_after_s=100.0)
    alder = Connection(1, vendor="Alder")
    lines = [receiving_fleet.receive(status(f"A-{i}", NOW_S), NOW_S, alder) for i in range(5)]
    assert lines == [None, None, None, "robots-too-many", "robots-too-many"]
    assert receiving_fleet.receive(status("A-1", NOW_S + 1), NOW_S + 1, alder) is None
    assert receiving_fleet.receive(status("B-1", NOW_S), NOW_S, Connection(2, vendor="Basalt")) is None
    receiving_fleet.next_batch(NOW_S + 101)
    assert receiving_fleet.receive(status("A-9", NOW_S + 102), NOW_S + 102, alder) is None


def test_a_robot_known_by_name_has_its_uuid_everywhere() -> None:
    receiving_fleet = fleet(Vendor(name="Alder", names_as_uuid=True))
    alder = Connection(1, vendor="Alder")
    for raw in (identity("A-1", NOW_S, uuid="Truck 7"), status("A-1", NOW_S, uuid="Truck 7")):
        assert receiving_fleet.receive(raw, NOW_S, alder) is None
    (answer,) = documents(receiving_fleet, NOW_S)
    assert (
        answer["uuid"]
        == receiving_fleet.next_batch(NOW_S).robots[0]
        == answer["identity"]["uuid"]
        == answer["status"]["uuid"]
    )


def test_vendors_that_only_messages_name_are_bounded() -> None:
    receiving_fleet = fleet()
    for i in range(80):
        receiving_fleet.receive(identity(f"R-{i}", NOW_S, manufacturerName=f"Maker {i}"), NOW_S, Connection(i))
    names = {each["vendor"] for each in documents(receiving_fleet, NOW_S)}
    assert OTHER in names
    assert len(names) == 65


def test_a_rejected_message_is_counted_and_kept_for_a_person() -> None:
    receiving_fleet = fleet()
    rule = receiving_fleet.receive(b'{"uuid": 3}', NOW_S, LINE)
    assert rule is not None
    assert counted(receiving_fleet, "messages_total")[UNKNOWN, "rejected"] == 1
    assert counted(receiving_fleet, "rejections_total")[UNKNOWN, rule] == 1
    (kept,) = receiving_fleet.quarantine.documents()
    assert kept["rule"] == rule
    assert len(receiving_fleet.next_batch(NOW_S)) == 0


def test_the_newest_status_wins_and_what_it_replaced_is_counted() -> None:
    receiving_fleet = fleet()
    for i in range(3):
        receiving_fleet.receive(status("A-1", NOW_S + i, float(i)), NOW_S + i, LINE)
    batch = receiving_fleet.next_batch(NOW_S + 3)
    assert batch.forecasts.x_m[0] == 2.0
    assert counted(receiving_fleet, "statuses_superseded_total")[UNKNOWN,] == 2
    assert (batch.statuses[0], batch.first_arrival_s[0], batch.arrival_s[0]) == (3, NOW_S, NOW_S + 2)


def test_a_document_says_what_a_robot_is_doing_as_far_as_the_robot_says() -> None:
    receiving_fleet = fleet()
    stops = [
        {**point, "planarDatum": HALL} for point in points((NOW_S + 60, 5.0, 6.0, 0.0), (NOW_S + 90, 9.0, 6.0, 0.0))
    ]
    amounts = {"batteryPercentage": 83.0, "remainingRunTime": 2.0, "loadPercentageStillAvailable": 75.0}
    receiving_fleet.receive(status("A-1", NOW_S, destinations=stops, **amounts), NOW_S, LINE)
    receiving_fleet.receive(status("A-2", NOW_S, 3.0), NOW_S, LINE)
    receiving_fleet.next_batch(NOW_S)
    shown = document(receiving_fleet, "A-1")
    assert shown["destination"] == {"floor": HALL, "x": 5.0, "y": 6.0, "expected_s": NOW_S + 60}
    assert (shown["battery_pct"], shown["run_time_left_s"], shown["load_used_pct"]) == (83.0, 7200.0, 25.0)
    silent = document(receiving_fleet, "A-2")
    assert [silent[name] for name in ("destination", "battery_pct", "run_time_left_s", "load_used_pct")] == [None] * 4


def test_a_repeated_robot_brings_no_status() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, LINE)
    assert receiving_fleet.next_batch(NOW_S + 0.1).statuses.tolist() == [1]
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    assert receiving_fleet.next_batch(NOW_S + 0.2).statuses.tolist() == [0]
    assert receiving_fleet.next_batch(NOW_S + 0.3, everything=True).statuses.tolist() == [0]


def test_a_status_that_is_older_than_the_last_is_counted_and_does_not_move_the_robot() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A-1", NOW_S, 5.0), NOW_S + 0.1, LINE)
    receiving_fleet.receive(status("A-1", NOW_S - 1.0, 4.0), NOW_S + 0.2, LINE)
    assert document(receiving_fleet, "A-1")["location"]["x"] == 5.0
    assert document(receiving_fleet, "A-1")["deviations"]["stamp-not-increasing"] == 1


def test_a_clock_three_seconds_off_is_shown_and_corrected() -> None:
    receiving_fleet = fleet()
    for i in range(5):
        path = points((NOW_S + i + 4, 1.0, 0.0, 0.0))
        receiving_fleet.receive(status("A-1", NOW_S + i + 3.0, path=path), NOW_S + i + 0.05, LINE)
    batch = receiving_fleet.next_batch(NOW_S + 5)
    assert batch.event_s[0] == pytest.approx(NOW_S + 4, abs=0.3)
    assert batch.forecasts.t_s[1] == pytest.approx(NOW_S + 5, abs=0.3)
    assert document(receiving_fleet, "A-1")["clock"]["offset_s"] == pytest.approx(-3.0, abs=0.3)
    assert document(receiving_fleet, "A-1")["deviations"]["clock-off"] == 5


def test_a_clock_set_forward_leaves_the_forecast_where_it_belongs_from_the_first_message_on() -> None:
    receiving_fleet = fleet()
    for i, ahead_s in enumerate((0.0, 0.0, 0.0, 3600.0)):
        stamp_s = NOW_S + i + ahead_s
        path = points((stamp_s + 4, 4.0, 0.0, 0.0))
        receiving_fleet.receive(status("A-1", stamp_s, path=path), NOW_S + i + 0.1, LINE)
    batch = receiving_fleet.next_batch(NOW_S + 4)
    assert batch.forecasts.t_s.tolist() == pytest.approx([NOW_S + 3, NOW_S + 7, NOW_S + 13], abs=0.15)


@pytest.mark.parametrize(
    ("fast_s", "is_known", "begins_s"), [(0.0, False, 3.0), (60.0, False, 0.0), (-60.0, False, 0.0), (60.0, True, 3.0)]
)
def test_a_path_of_a_status_without_a_stamp_begins_when_it_says_if_that_is_ahead(
    fast_s: float, is_known: bool, begins_s: float
) -> None:
    receiving_fleet = fleet()
    if is_known:
        receiving_fleet.receive(status("A-1", NOW_S - 1 + fast_s, -1.0), NOW_S - 1, LINE)
    path = points(*((NOW_S + fast_s + s, s, 0.0, 0.0) for s in (3.0, 4.0, 8.0)))
    receiving_fleet.receive(status("A-1", NOW_S, path=path, timestamp=None), NOW_S, LINE)
    forecast = receiving_fleet.robots[robot("A-1")].forecast
    assert forecast is not None
    at_four_metres = [knot[0] - NOW_S for knot in forecast.knots if knot[1] == 4.0]
    assert at_four_metres == pytest.approx([begins_s + 1.0])


def test_stamps_in_whole_seconds_are_corrected_in_the_forecast_too() -> None:
    receiving_fleet = fleet()
    for i in range(3):
        path = points((NOW_S + i + 4, 4.0, 0.0, 0.0))
        stamp = f"2026-09-21T14:13:{20 + i}+0000"
        receiving_fleet.receive(status("A-1", NOW_S + i, timestamp=stamp, path=path), NOW_S + i + 0.8, LINE)
    batch = receiving_fleet.next_batch(NOW_S + 4)
    assert batch.forecasts.t_s.tolist() == pytest.approx([NOW_S + 2.8, NOW_S + 6.8, NOW_S + 12.8], abs=0.01)


def test_a_vendor_adds_a_limited_number_of_floors_by_unknown_datums() -> None:
    receiving_fleet = fleet(Vendor(name="Alder"), Vendor(name="Mallory"))
    mallory, alder = Connection(1, vendor="Mallory"), Connection(2, vendor="Alder")
    for i in range(2 * MOST_UNKNOWN):
        here = {"x": 1.0, "y": 2.0, "planarDatum": robot(f"floor {i}")}
        path = [{"timestamp": stamp(NOW_S + i + 1), "x": 1.0, "y": 2.0, "planarDatumUUID": robot(f"far {i}")}]
        receiving_fleet.receive(status("M-1", NOW_S + i, location=here, path=path), NOW_S + i, mallory)
    assert len(receiving_fleet.next_batch(NOW_S).floors) == MOST_UNKNOWN
    assert document(receiving_fleet, "M-1")["deviations"]["datum-too-many"] >= MOST_UNKNOWN
    receiving_fleet.receive(status("A-1", NOW_S, location={"x": 1.0, "y": 2.0, "planarDatum": LOFT}), NOW_S, alder)
    receiving_fleet.receive(status("A-2", NOW_S), NOW_S, alder)
    batch = receiving_fleet.next_batch(NOW_S)
    assert [batch.floors[floor] for floor in batch.forecasts.floor[batch.forecasts.start[:-1]]] == [LOFT, HALL]


def test_a_map_name_of_any_length_makes_no_batch_and_no_sentence_long() -> None:
    of, letters = fleet(), 70_000
    for number in range(2 * MOST_UNKNOWN):
        name = f"{number} " + "m" * letters
        ahead = [
            vda_saying.node(each, 5.0 * each, nodePosition={"x": 5.0 * each, "y": 0.0, "mapId": name})
            for each in (1, 2)
        ]
        place = vda_saying.position(mapId=f"{name} here")
        t_s = NOW_S + 2 * number
        of.receive(vda_saying.order(t_s, ahead), t_s, vda_saying.line("order"))
        state = vda_saying.under_way(t_s + 1, 0.0, 0.0, ahead, agvPosition=place)
        assert of.receive(state, t_s + 1, vda_saying.line("state")) is None
    of.receive(
        iso_saying.iso(NOW_S, pose={"locationPoint": iso_saying.at(0.0, 0.0, ccsId=name)}),
        NOW_S,
        iso_saying.line("odometry"),
    )
    batch = of.next_batch(NOW_S)
    assert len(batch.robots) == 2
    assert len(batch.to_bytes()) < 10_000
    assert len(json.dumps([documents(of), fleet_report.senders(of, NOW_S)])) < 20_000
    assert all("more than 200 letters" in shown["not_compared_reason"] for shown in documents(of))
    assert all(shown["deviations"]["datum-unknown"] for shown in documents(of))


def test_an_unknown_datum_is_a_floor_of_its_own_and_found() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, LINE)
    receiving_fleet.receive(status("B-1", NOW_S, location=_at(LOFT)), NOW_S, LINE)
    batch = receiving_fleet.next_batch(NOW_S)
    floors = dict(zip(batch.robots, batch.forecasts.floor.tolist(), strict=True))
    assert floors[robot("A-1")] != floors[robot("B-1")]
    assert document(receiving_fleet, "B-1")["deviations"]["datum-unknown"] == 1
    assert "datum-unknown" not in document(receiving_fleet, "A-1")["deviations"]


@pytest.mark.parametrize("datum", [NIL, ""])
def test_no_datum_at_all_is_compared_with_nothing(datum: str) -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A-1", NOW_S, location=_at(datum)), NOW_S, LINE)
    assert receiving_fleet.next_batch(NOW_S).forecasts.floor.tolist() == [NOWHERE]
    assert document(receiving_fleet, "A-1")["comparable"] is False


def test_a_lost_robot_is_doubtful() -> None:
    receiving_fleet = fleet(lost_doubt_m=1.5)
    receiving_fleet.receive(status("A-1", NOW_S, errorCodes=["Robot Lost"]), NOW_S, LINE)
    assert receiving_fleet.next_batch(NOW_S).doubt_m[0] == 1.5


def test_a_batch_has_the_battery_of_the_newest_status() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A", NOW_S, batteryPercentage=61.5, remainingRunTime=1.5), NOW_S, LINE)
    receiving_fleet.receive(status("B", NOW_S), NOW_S, LINE)
    amounts = receiving_fleet.next_batch(NOW_S).amounts
    assert (amounts["battery_pct"][0], amounts["run_time_left_s"][0]) == (61.5, 5400.0)
    assert np.isnan([amounts["battery_pct"][1], amounts["run_time_left_s"][1]]).all()
    receiving_fleet.receive(status("A", NOW_S + 1), NOW_S + 1, LINE)
    assert np.isnan(receiving_fleet.next_batch(NOW_S + 1).amounts["battery_pct"][0])


def test_the_load_changes_the_envelope() -> None:
    model = Model(loaded_envelope_m=(1.5, 1.2, 1.8))
    receiving_fleet = fleet(Vendor(name="Alder", models={"A1": model}))
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    receiving_fleet.receive(status("A-1", NOW_S, loadPercentageStillAvailable=100), NOW_S, LINE)
    assert receiving_fleet.next_batch(NOW_S).forecasts.length_m[0] == 1.0
    receiving_fleet.receive(status("A-1", NOW_S + 1, loadPercentageStillAvailable=40), NOW_S + 1, LINE)
    assert receiving_fleet.next_batch(NOW_S + 1).forecasts.length_m[0] == 1.5


def test_silence_never_removes_a_robot_until_it_is_forgotten_and_counted() -> None:
    receiving_fleet = fleet(forget_after_s=3600.0)
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, LINE)
    receiving_fleet.next_batch(NOW_S)
    assert [document(receiving_fleet, "A-1", NOW_S + t)["presence"] for t in (1, 31, 61)] == [
        "present",
        "quiet",
        "silent",
    ]
    assert receiving_fleet.next_batch(NOW_S + 3599).gone == ()
    assert receiving_fleet.next_batch(NOW_S + 3601).gone == (robot("A-1"),)
    assert counted(receiving_fleet, "robots_forgotten_total")[UNKNOWN,] == 1
    assert documents(receiving_fleet, NOW_S + 3601) == []


def test_the_robots_document_has_everything_that_its_messages_said() -> None:
    receiving_fleet = fleet()
    optional = {
        "maxSpeed": 1.5,
        "maxRunTime": 8,
        "emergencyContactInformation": "+1 555 0100",
        "chargerType": "inductive",
        "supportVendorName": "Alder Care",
        "supportVendorContactInformation": "care",
        "productDocumentation": "about:blank",
        "thumbnailImage": "about:blank",
        "cargoType": "totes",
        "cargoMaxVolume": {"x": 1, "y": 1, "z": 1},
        "cargoMaxWeight": "4000",
    }
    answer: dict[str, Any] = {
        "batteryPercentage": 81.5,
        "remainingRunTime": 3.2,
        "loadPercentageStillAvailable": 60,
        "errorCodes": ["battery low"],
        "velocity": {"linear": 0.5},
    }
    receiving_fleet.receive(identity("A-1", NOW_S, **optional), NOW_S, LINE)
    receiving_fleet.receive(
        status("A-1", NOW_S, destinations=points((NOW_S + 60, 9.0, 9.0, 0.0)), **answer), NOW_S, LINE
    )
    served = json.loads(json.dumps(document(receiving_fleet, "A-1")))
    assert {key: served["identity"][key] for key in optional} == optional
    assert {key: served["status"][key] for key in answer} == answer
    assert served["status"]["destinations"][0]["x"] == 9.0
    assert served["forecast"]["basis"] == "velocity"


def test_of_a_long_message_the_document_has_the_length() -> None:
    receiving_fleet = fleet()
    raw = status("A-1", NOW_S, note="a" * fleet_report.MOST_SHOWN_BYTES)
    receiving_fleet.receive(raw, NOW_S, LINE)
    assert document(receiving_fleet, "A-1")["status"] == {"uuid": robot("A-1"), "too_long_bytes": len(raw)}


def test_levels_are_by_vendor_and_state() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, LINE)
    receiving_fleet.receive(status("A-2", NOW_S, operationalState="dancing"), NOW_S, LINE)
    fleet_report.measure(receiving_fleet, NOW_S + 2)
    assert counted(receiving_fleet, "robots") == {("Alder", "navigating"): 1, ("Alder", "other"): 1}
    assert counted(receiving_fleet, "forecast_age_seconds")["Alder",] == pytest.approx(2.0)
    fleet_report.measure(receiving_fleet, NOW_S + 100)
    assert counted(receiving_fleet, "robots") == {("Alder", "silent"): 2}


def test_the_same_messages_give_the_same_batches() -> None:
    def told() -> bytes:
        receiving_fleet = fleet()
        random = np.random.default_rng(3)
        for i in range(200):
            name = f"R-{random.integers(10)}"
            x, y, yaw_rad = random.uniform(-3, 20, 3).tolist()
            raw = status(name, NOW_S + i, x, y, yaw_rad)
            receiving_fleet.receive(raw, NOW_S + i + 0.1, LINE)
        return receiving_fleet.next_batch(NOW_S + 201).to_bytes()

    assert told() == told()


def test_basis_of_a_robot_that_only_sends_where_it_is_comes_from_its_motion() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A-1", NOW_S, 0.0), NOW_S, LINE)
    receiving_fleet.receive(status("A-1", NOW_S + 1, 1.0), NOW_S + 1, LINE)
    batch = receiving_fleet.next_batch(NOW_S + 1)
    assert batch.basis.tolist() == [Basis.VELOCITY]
    assert batch.forecasts.x_m[-1] == pytest.approx(11.0)


def _at(datum: str) -> dict[str, Any]:
    return {"x": 0.0, "y": 0.0, "angle": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "planarDatum": datum}


def test_stamps_in_whole_seconds_are_no_sign_of_a_wrong_clock() -> None:
    receiving_fleet = fleet()
    for i in range(5):
        stamp = f"2026-09-21T14:13:2{i}+0000"
        receiving_fleet.receive(status("A-1", 0.0, timestamp=stamp), NOW_S + i + 0.7, LINE)
    assert "clock-off" not in document(receiving_fleet, "A-1")["deviations"]


def test_degrees_that_no_place_has_are_rejected_and_the_robot_stays_where_it_was() -> None:
    hall = Datum(id=HALL, name="Hall", coordinates="latlon", reference_location=(42.36, -71.06))
    receiving_fleet = fleet(datums=(hall,))
    assert receiving_fleet.receive(status("A-1", NOW_S, 42.3601, -71.0601), NOW_S, LINE) is None
    assert receiving_fleet.receive(status("A-1", NOW_S + 1, 1200.0, -71.0601), NOW_S + 1, LINE) == "position-absurd"
    assert abs(document(receiving_fleet, "A-1")["location"]["x"]) < 20
    path = points((NOW_S + 3, 4e6, 0.0, 0.0), (NOW_S + 4, 42.3601, -71.0601, 0.0))
    receiving_fleet.receive(status("A-1", NOW_S + 2, 42.3601, -71.0601, path=path), NOW_S + 2, LINE)
    forecasts = receiving_fleet.next_batch(NOW_S + 2).forecasts
    assert np.isfinite(forecasts.x_m).all()
    assert len(forecasts.t_s) == 2


def test_a_status_that_took_long_is_stale() -> None:
    receiving_fleet = fleet()
    for i in range(4):
        receiving_fleet.receive(status("A-1", NOW_S + i), NOW_S + i + 0.05, LINE)
    receiving_fleet.receive(status("A-1", NOW_S + 4), NOW_S + 7, LINE)
    assert document(receiving_fleet, "A-1")["deviations"]["stamp-stale"] == 1
