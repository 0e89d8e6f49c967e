"""A robot that is heard and compared with nobody says so, why, and what to send."""

from collections.abc import Callable
from typing import Any

import pytest

from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.languages import timestamps
from ingest.languages.model import Status, Update
from ingest.languages.rules import Oddity
from ingest.languages.vda5050 import vda_front_end
from ingest.port.connection import Connection
from ingest.settings import NIL_DATUM, Datum, Vendor
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL, identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, counted, document, fleet

NOT_COMPARED = "robots_not_compared"
SENDERS: dict[str, tuple[Callable[[float], bytes], Connection, str]] = {
    "identity": (lambda t_s: identity("A-1", t_s), LINE, "`location`"),
    "factsheet": (vda_saying.factsheet, vda_saying.line("factsheet"), "`agvPosition`"),
    "order": (lambda t_s: vda_saying.order(t_s, []), vda_saying.line("order"), "`agvPosition`"),
    "connection": (
        lambda t_s: vda_saying.vda(t_s, connectionState="ONLINE"),
        vda_saying.line("connection"),
        "`agvPosition`",
    ),
    "state": (lambda t_s: vda_saying.state(t_s, agvPosition=None), vda_saying.line("state"), "`agvPosition`"),
    "iso identity": (iso_saying.identity, iso_saying.line("identity"), "`odometry`"),
    "iso status": (lambda t_s: iso_saying.states(t_s, "MODE_AUTOMATIC"), iso_saying.line("status"), "`odometry`"),
}
"""Messages without a position: how each is made, over which connection it comes, and what is missing."""


def only(of: Fleet, now_s: float) -> dict[str, Any]:
    (known,) = of.robots.values()
    return fleet_report.robot_document(of, known, now_s)


def measured(of: Fleet, now_s: float) -> dict[tuple[str, ...], float]:
    fleet_report.measure(of, now_s)
    return counted(of, NOT_COMPARED)


@pytest.mark.parametrize("kind", SENDERS)
def test_a_robot_without_any_position_is_listed_with_what_to_send(kind: str) -> None:
    of, (made, line, key) = fleet(), SENDERS[kind]
    for second in range(0, 41, 10):
        assert of.receive(made(NOW_S + second), NOW_S + second, line) is None
    shown = only(of, NOW_S + 41)
    assert (shown["compared"], shown["presence"], shown["location"]) == (False, "present", None)
    assert shown["not_compared_reason"].startswith("no position of it has come (heard: ")
    assert key in shown["not_compared_reason"]
    assert measured(of, NOW_S + 41) == {(shown["vendor"], "no position"): 1.0}


@pytest.mark.parametrize("kind", SENDERS)
def test_a_robot_that_was_just_heard_first_is_no_fault(kind: str) -> None:
    of, (made, line, _) = fleet(), SENDERS[kind]
    for second in (0, 10, 20):
        of.receive(made(NOW_S + second), NOW_S + second, line)
    assert only(of, NOW_S + 25)["compared"] is False
    assert measured(of, NOW_S + 25) == {}


@pytest.mark.parametrize("kind", ["factsheet", "identity", "iso identity"])
def test_a_robot_of_which_a_broker_retains_something_is_no_fault(kind: str) -> None:
    of, (made, line, _) = fleet(), SENDERS[kind]
    of.receive(made(NOW_S), NOW_S, line)
    assert measured(of, NOW_S + 45) == {}
    assert measured(of, NOW_S + 4500) == {}


def test_a_robot_whose_statuses_are_all_rejected_is_a_fault_although_its_identity_came_once() -> None:
    of = fleet()
    of.receive(identity("A-1", NOW_S), NOW_S, LINE)
    for second in range(40):
        assert of.receive(status("A-1", NOW_S + second, location=None), NOW_S + second, LINE)
    assert measured(of, NOW_S + 40) == {("Alder", "not read"): 1.0}
    why = "40 messages rejected, the last: location: is missing"
    assert document(of, "A-1", NOW_S + 40)["not_compared_reason"] == why
    (vendor,) = fleet_report.senders(of, NOW_S + 40)
    assert [(row["reason"], row["fault"]) for row in vendor["not_compared"]] == [(why, "not read")]


def test_a_robot_whose_statuses_are_rejected_from_some_time_on_says_why_until_one_is_read() -> None:
    of = fleet()
    for second in range(100):
        where: dict[str, Any] = {} if second < 3 else {"location": None}
        of.receive(status("A-1", NOW_S + second, **where), NOW_S + second, LINE)
        if second < 30:
            assert measured(of, NOW_S + second) == {}
    why = "97 messages rejected, the last: location: is missing"
    assert document(of, "A-1", NOW_S + 100)["not_compared_reason"] == why
    of.receive(status("A-1", NOW_S + 101), NOW_S + 101, LINE)
    assert document(of, "A-1", NOW_S + 101)["compared"] is True
    for second in range(102, 104):
        of.receive(status("A-1", NOW_S + second, location=None), NOW_S + second, LINE)
    assert (of.robots[robot("A-1")].rejected, document(of, "A-1", NOW_S + 103)["compared"]) == (2, True)


def test_a_robot_with_a_position_is_compared_also_if_it_is_alone() -> None:
    of = fleet()
    of.receive(status("A-1", NOW_S), NOW_S, LINE)
    shown = document(of, "A-1")
    assert (shown["compared"], shown["not_compared_reason"]) == (True, None)
    assert measured(of, NOW_S) == {}


def test_a_robot_whose_position_stops_while_it_is_heard_is_a_fault() -> None:
    of, line = fleet(datums=(Datum(id=vda_saying.MAP, name="Hall"),)), vda_saying.line("state")
    of.receive(vda_saying.state(NOW_S), NOW_S, line)
    for second in range(1, 90):
        of.receive(vda_saying.state(NOW_S + second, agvPosition=None), NOW_S + second, line)
    shown = only(of, NOW_S + 90)
    assert shown["compared"] is False
    assert "no position for 90 s" in shown["not_compared_reason"]
    assert measured(of, NOW_S + 90) == {(vda_saying.MAKER, "position stopped"): 1.0}
    assert measured(of, NOW_S + 900) == {}, "it is silent"


@pytest.mark.parametrize("datum", [None, "", NIL_DATUM])
def test_a_position_without_a_map_says_which_key_to_send(datum: str | None) -> None:
    of = fleet(Vendor(name="Alder", robots=(robot("A-1"),)))
    where = {"x": 1.0, "y": 2.0, "angle": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "planarDatum": datum}
    place = {key: value for key, value in where.items() if value is not None}
    assert of.receive(status("A-1", NOW_S, location=place), NOW_S, LINE) is None
    shown = document(of, "A-1")
    assert shown["compared"] is False
    assert shown["not_compared_reason"] == (
        "its position names no map; send `location.planarDatum`, "
        'or give Alder a map with datum = "" in vendors.maps of the site file'
    )
    assert measured(of, NOW_S) == {("Alder", "no map"): 1.0}


def test_a_robot_alone_on_a_map_that_the_site_file_does_not_have_is_told_of_the_nearest() -> None:
    of, misspelt = fleet(), HALL.replace("0d6f", "0d6e")
    place = {"x": 1.0, "y": 2.0, "angle": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "planarDatum": misspelt}
    of.receive(status("A-1", NOW_S, location=place), NOW_S, LINE)
    of.receive(status("A-2", NOW_S), NOW_S, LINE)
    shown = document(of, "A-1")
    assert shown["compared"] is False
    assert f"{misspelt!r}, which the site file does not have (did you mean {HALL!r}?)" in shown["not_compared_reason"]
    assert document(of, "A-2")["compared"] is True
    of.receive(status("A-3", NOW_S, location=place), NOW_S, LINE)
    assert document(of, "A-1")["compared"] is True, "two robots on a floor of their own are compared with each other"


def test_without_a_site_file_a_robot_alone_on_its_map_is_no_fault() -> None:
    of = fleet(datums=())
    of.receive(status("A-1", NOW_S), NOW_S, LINE)
    assert document(of, "A-1")["compared"] is True


def test_values_that_deviate_are_named_at_the_robot_and_by_vendor(monkeypatch: pytest.MonkeyPatch) -> None:
    odd = Oddity("number-as-text", "agvPosition.mapId", "3", 'read as "3"')
    of, read = fleet(), vda_front_end.VdaFrontEnd.read

    def with_oddity(*arguments: Any) -> Any:
        message, memory = read(*arguments)
        assert isinstance(message, Status | Update)
        fields = {key: getattr(message, key) for key in message.__struct_fields__} | {"oddities": (odd,)}
        return type(message)(**fields), memory

    monkeypatch.setattr(vda_front_end.VdaFrontEnd, "read", with_oddity)
    for second in range(3):
        of.receive(vda_saying.state(NOW_S + second), NOW_S + second, vda_saying.line("state"))
    shown = only(of, NOW_S + 3)["odd_values"][0]
    assert shown == {**odd._asdict(), "count": 3, "last_received": timestamps.write(NOW_S + 2)}
    (vendor,) = fleet_report.senders(of, NOW_S + 3)
    assert vendor["vendor"] == vda_saying.MAKER
    assert {**shown, "robots": 1} in vendor["odd_values"]


def test_what_vendors_should_mend_has_the_robots_that_are_compared_with_nobody() -> None:
    of = fleet()
    for second in range(0, 41, 10):
        of.receive(identity("A-1", NOW_S + second), NOW_S + second, LINE)
        of.receive(status("A-2", NOW_S + second), NOW_S + second, LINE)
    (vendor,) = fleet_report.senders(of, NOW_S + 40)
    (row,) = vendor["not_compared"]
    assert (vendor["vendor"], row["uuid"], row["placed"]) == ("Alder", robot("A-1"), False)
    assert row["reason"] == document(of, "A-1", NOW_S + 40)["not_compared_reason"]


def test_a_robot_of_which_every_message_is_rejected_is_listed_with_the_reason() -> None:
    of = fleet(Vendor(name="Alder", robots=(robot("A-1"), robot("A-2"))))
    for second in range(3):
        of.receive(status("A-1", NOW_S + second), NOW_S + second, LINE)
        assert of.receive(status("A-2", NOW_S + second, location="here"), NOW_S + second, LINE)
    assert measured(of, NOW_S + 3) == {("Alder", "not read"): 1.0}
    (vendor,) = fleet_report.senders(of, NOW_S + 3)
    (row,) = vendor["not_compared"]
    assert (row["uuid"], row["fault"], row["placed"]) == (robot("A-2"), "not read", False)
    assert row["reason"].startswith("all its messages are rejected (")
    of.receive(status("A-2", NOW_S + 4), NOW_S + 4, LINE)
    assert measured(of, NOW_S + 5) == {}


def test_one_message_that_is_rejected_and_those_of_nobodys_robots_are_no_fault() -> None:
    of = fleet(Vendor(name="Alder", robots=(robot("A-1"),)))
    of.receive(status("A-1", NOW_S, location="here"), NOW_S, LINE)
    for second in range(3):
        of.receive(status("X-1", NOW_S + second, location="here"), NOW_S + second, LINE)
    assert measured(of, NOW_S + 3) == {}


def test_what_only_history_and_the_site_show_is_named_too() -> None:
    of, misspelt = fleet(), HALL.replace("0d6f", "0d6e")
    place = {"x": 1.0, "y": 2.0, "angle": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "planarDatum": misspelt}
    for second in range(3):
        of.receive(status("A-1", NOW_S + second - 5.0, location=place), NOW_S + second, LINE)
    shown = {row["rule"]: row for row in document(of, "A-1", NOW_S + 3)["odd_values"]}
    unknown = shown["datum-unknown"]
    assert (unknown["path"], unknown["value"], unknown["nearest"]) == ("location.planarDatum", f'"{misspelt}"', HALL)
    assert (unknown["reading"], unknown["count"]) == ("a floor of its own", 3)
    assert (shown["clock-off"]["value"], shown["clock-off"]["reading"]) == ("5.0 s behind", "corrected by 5.0 s")
    assert (shown["identity-missing"]["path"], shown["identity-missing"]["reading"]) == (
        "identityReport",
        "the default size",
    )
    of.receive(identity("A-1", NOW_S + 4), NOW_S + 4, LINE)
    assert "identity-missing" not in {row["rule"] for row in document(of, "A-1", NOW_S + 4)["odd_values"]}


def test_a_vendor_with_people_and_robots_says_how_many_of_each() -> None:
    walkers = Vendor(name="Alder", participants={"person": (robot("A-2"),)})
    of = fleet(walkers)
    for row, name in enumerate(("A-1", "A-2", "A-3")):
        of.receive(identity(name, NOW_S, manufacturerName="Alder"), NOW_S, LINE)
        of.receive(status(name, NOW_S, 5.0 * row), NOW_S, LINE)
    (vendor,) = fleet_report.senders(of, NOW_S)
    assert vendor["participants"] == {"robot": 2, "person": 1}
