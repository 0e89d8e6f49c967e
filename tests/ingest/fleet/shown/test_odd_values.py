"""The values of a robot's messages that deviate, for people."""

from typing import Any

import pytest

from ingest.fleet.shown.odd_values import MOST_KEPT, MOST_OF_VENDOR, OddValues, by_vendor
from ingest.languages.rules import Findings, Oddity
from ingest.languages.timestamps import write
from ingest.port.connection import Connection
from tests.helpers.iso_saying import identity as iso_identity
from tests.helpers.iso_saying import iso, odometry, states, trajectory
from tests.helpers.iso_saying import line as iso_line
from tests.helpers.saying import identity, points, status
from tests.helpers.vda_saying import factsheet, state, state_3
from tests.helpers.vda_saying import line as vda_line
from tests.ingest.fleet.made_fleet import LINE, NOW_S, documents, hall

MAP = Oddity("number-as-text", "agvPosition.mapId", "3", 'read as "3"')
KEY = Oddity("key-unknown", "location.planarDatm", '"hall"', "not read", "planarDatum")


def test_values_are_counted_by_rule_and_path_and_the_newest_is_shown() -> None:
    values = OddValues()
    values.note((MAP, KEY), 1_790_000_000.0)
    values.note((MAP._replace(value="4"), MAP._replace(value="5")), 1_790_000_001.0)
    assert [value.document() for value in values.newest_first()] == [
        {
            "rule": "number-as-text",
            "path": "agvPosition.mapId",
            "value": "5",
            "reading": 'read as "3"',
            "nearest": "",
            "count": 2,
            "last_received": "2026-09-21T14:13:21.000000Z",
        },
        {**KEY._asdict(), "count": 1, "last_received": "2026-09-21T14:13:20.000000Z"},
    ]


def test_places_in_a_list_are_one_row_counted_by_message() -> None:
    values = OddValues()
    for _ in range(3):
        values.note(tuple(MAP._replace(path=f"path[{row}].timestamp") for row in range(6)), 1.0)
    assert [(value.newest.path, value.count) for value in values.newest_first()] == [("path[*].timestamp", 3)]


def test_a_long_list_in_a_message_leaves_room_for_other_values() -> None:
    findings = Findings()
    for row in range(100):
        findings.note("stamp-epoch", f"path[{row}].timestamp", row, "read")
    findings.note("key-unknown", "loction", {}, "not used", "location")
    assert [oddity.path for oddity in findings.oddities] == [*(f"path[{row}].timestamp" for row in range(3)), "loction"]


def test_a_sender_that_makes_up_paths_displaces_its_oldest() -> None:
    values = OddValues()
    for number in range(10 * MOST_KEPT):
        values.note((MAP._replace(path=f"a{number}"), KEY), float(number))
    kept = values.newest_first()
    assert len(kept) == MOST_KEPT
    assert kept[0].newest.path == KEY.path
    assert kept[0].count == 10 * MOST_KEPT


def test_a_vendors_values_have_the_number_of_robots_and_a_newest_example() -> None:
    first, second, other = OddValues(), OddValues(), OddValues()
    first.note((MAP,), 1.0)
    first.note((KEY,), 2.0)
    second.note((MAP._replace(value="7"),), 3.0)
    other.note((KEY,), 4.0)
    rows = ("Alder", first), ("Alder", second), ("Basalt", other), ("Corvid", OddValues())
    joined = by_vendor((vendor, values.newest_first()) for vendor, values in rows)
    assert joined.keys() == {"Alder", "Basalt"}
    shown = [(row["path"], row["value"], row["robots"], row["count"]) for row in joined["Alder"]]
    assert shown == [(MAP.path, "7", 2, 2), (KEY.path, '"hall"', 1, 1)]


def test_a_vendors_values_are_bounded() -> None:
    robots = []
    for number in range(10):
        values = OddValues()
        values.note(tuple(MAP._replace(path=f"a{number}.{i}") for i in range(MOST_KEPT)), 1.0)
        robots.append(("Alder", values.newest_first()))
    assert len(by_vendor(robots)["Alder"]) == MOST_OF_VENDOR


def point(t_s: float, x: float = 1.0, **replaced: Any) -> dict[str, Any]:
    return points((t_s, x, 0.0, 0.0))[0] | replaced


BEGUN, MANY = [point(NOW_S - 9), point(NOW_S + 1)], [point(NOW_S + 9 * n) for n in range(1, 12)]
ZEROS = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
FAR = {"x": 2e7, "y": 0.0, "theta": 0.0}
FASTER, LATER = {"vx": 300.0, "vy": 0.0, "omega": 0.0}, NOW_S + 2
WAY = [{"x": 1.0, "y": 0.0, "eta": write(LATER)}, {"x": 2.0, "y": 0.0, "eta": write(NOW_S + 1)}]
NAMED: list[tuple[str, Connection, bytes, str, str]] = [
    ("battery-out-of-range", vda_line("state"), state(NOW_S, batteryState={"batteryCharge": 180.0}), "180.0", "100"),
    ("speed-absurd", vda_line("state"), state(NOW_S, velocity=FASTER), "[300.0, 0.0]", "left out"),
    ("point-absurd", vda_line("state"), state_3(NOW_S, intermediatePath={"polyline": [FAR]}), "[20000000.0, 0.0]", ""),
    ("path-unordered", vda_line("state"), state_3(NOW_S, intermediatePath={"polyline": WAY}), f"[{LATER:.1f}, ", ""),
    ("path-past", vda_line("state"), state_3(LATER + 5, intermediatePath={"polyline": WAY[:1]}), f"{LATER:.1f}", ""),
    (
        "speed-limit-not-positive",
        vda_line("factsheet"),
        factsheet(NOW_S, physicalParameters={"speedMax": -1.0, "length": 1.0, "width": 1.0}),
        "-1.0",
        "left out",
    ),
    ("speed-absurd", iso_line("odometry"), odometry(NOW_S, speed=-300.0), "-300.0", "left out"),
    ("mode-missing", iso_line("status"), states(NOW_S, "PARKED"), '["PARKED"]', "automatic"),
    ("battery-out-of-range", iso_line("batteryStatus"), iso(NOW_S, batterySoc=-0.5), "-0.5", "0 %"),
    ("speed-limit-not-positive", iso_line("identity"), iso_identity(NOW_S, ratedSpeed=0.0), "0.0", "left out"),
    ("point-absurd", iso_line("localTrajectory"), trajectory(NOW_S, (NOW_S, 2e7, 0.0)), "[20000000.0, 0.0]", ""),
    ("path-times-equal", iso_line("localTrajectory"), trajectory(NOW_S, (LATER, 0, 0), (LATER, 1, 0)), "[", ""),
    ("battery-out-of-range", LINE, status("A", NOW_S, batteryPercentage=-3.0), "-3.0", "0"),
    ("battery-fraction", LINE, status("A", NOW_S, batteryPercentage=0.7), "0.7", "percent"),
    ("run-time-negative", LINE, status("A", NOW_S, remainingRunTime=-1.0), "-1.0", "0"),
    ("speed-absurd", LINE, status("A", NOW_S, velocity={"linear": 300.0}), "300.0", "left out"),
    ("duplicate-items", LINE, status("A", NOW_S, errorCodes=["E1", "E1"]), '["E1", "E1"]', "as sent"),
    ("speed-limit-not-positive", LINE, identity("A", NOW_S, maxSpeed=-2.0), "-2.0", "left out"),
    ("text-empty", LINE, identity("A", NOW_S, robotModel=" "), '" "', "as sent"),
    ("text-too-long", LINE, identity("A", NOW_S, robotSerialNumber="S" * 101), '"SSS', "its first 100"),
    ("path-too-many", LINE, status("A", NOW_S, path=[point(NOW_S + n / 2) for n in range(1, 12)]), "11", "the first"),
    ("path-too-far", LINE, status("A", NOW_S, path=[point(NOW_S + 20)]), f"{NOW_S + 20:.1f}", "used when"),
    ("path-past", LINE, status("A", NOW_S, path=[point(NOW_S - 9)]), f"{NOW_S - 9:.1f}", "new times"),
    ("path-partly-past", LINE, status("A", NOW_S, path=BEGUN), f"{NOW_S - 9:.1f}", "the later ones"),
    ("path-unordered", LINE, status("A", NOW_S, path=BEGUN[::-1]), f"[{NOW_S + 1:.1f}, ", "sorted"),
    ("path-times-equal", LINE, status("A", NOW_S, path=[point(NOW_S + 1), point(NOW_S + 1, 1.0)]), "[", "left out"),
    ("angle-zero", LINE, status("A", NOW_S, path=[point(NOW_S + 1, angle=ZEROS)]), "[0.0, ", "heading unknown"),
    ("angle-missing", LINE, status("A", NOW_S, path=[point(NOW_S + 1, angle=None)]), "null", "heading unknown"),
    ("point-absurd", LINE, status("A", NOW_S, path=[point(NOW_S + 1, 2e7)]), "[20000000.0, ", "left out"),
    (
        "destinations-too-far",
        LINE,
        status("A", NOW_S, destinations=[point(NOW_S + 5000)]),
        f"{NOW_S + 5000:.1f}",
        "not",
    ),
    ("destinations-past", LINE, status("A", NOW_S, destinations=[point(NOW_S - 9)]), f"{NOW_S - 9:.1f}", "as sent"),
    ("destinations-unsorted", LINE, status("A", NOW_S, destinations=BEGUN[::-1]), "[", "sorted"),
    ("destinations-too-many", LINE, status("A", NOW_S, destinations=MANY), "11", "the first"),
]


@pytest.mark.parametrize(("rule", "connection", "raw", "value", "reading"), NAMED)
def test_a_value_out_of_range_is_named_with_its_path_and_how_it_is_read(
    rule: str, connection: Connection, raw: bytes, value: str, reading: str
) -> None:
    of = hall()
    of.receive(raw, LATER + 5, connection)
    (shown,) = documents(of)
    (named,) = [odd for odd in shown["odd_values"] if odd["rule"] == rule]
    assert named["path"]
    assert named["value"].startswith(value)
    assert named["reading"].startswith(reading)
