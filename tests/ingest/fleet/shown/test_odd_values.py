"""The values of a robot's messages that deviate, for people."""

from ingest.fleet.shown.odd_values import MOST_KEPT, MOST_OF_VENDOR, OddValues, by_vendor
from ingest.languages.rules import Findings, Oddity

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
