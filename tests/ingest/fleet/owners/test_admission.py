"""Which new robots are examined."""

from collections.abc import Iterable
from pathlib import Path

import pytest

from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.admission import (
    MINUTE_S,
    MOST_NAMED,
    MOST_WAITING,
    OTHERS,
    SETTLED_S,
    STARTS_S,
    UNEXAMINED,
    remedy,
)
from ingest.fleet.recovery.log_recovery import recover
from ingest.fleet.repeat_status import load
from ingest.fleet.shared_identities import INTRODUCER
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_reader import LogReader, Received
from ingest.recording.recorder import Recorder
from ingest.settings import RecorderSettings, Vendor
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import NOW_S, counted, document, fleet
from tests.ingest.fleet.recovery.made_kept_messages import kept_of, rows

HERE, THERE = Connection(1, "10.0.0.1"), Connection(2, "10.0.0.2")
KNOWN_S = NOW_S + SETTLED_S
"""By then a floor whose robots came at `NOW_S` is known."""


def report(of: Fleet, names: Iterable[str], at_s: float, connection: Connection = HERE) -> None:
    for name in names:
        of.receive(status(name, at_s), at_s, connection)


def named(prefix: str, count: int) -> list[str]:
    return [f"{prefix}-{number}" for number in range(count)]


def examined(of: Fleet) -> int:
    return sum(each.examined for each in of.robots.values())


def known_floor(robots: int = 5, *vendors: Vendor) -> Fleet:
    of = fleet(*vendors)
    report(of, named("K", robots), NOW_S)
    return of


def test_a_floor_that_starts_examines_all_robots_at_once() -> None:
    of = fleet()
    for second in range(10):
        report(of, named(f"S{second}", 100), NOW_S + 10 * second)
    assert examined(of) == 1000
    assert all(of.next_batch(NOW_S + 100).examined)


def test_a_start_ends_once_no_robot_comes_or_after_a_few_minutes() -> None:
    of = known_floor()
    report(of, named("N", 100), NOW_S + SETTLED_S - 1)
    assert examined(of) == 105
    for minute in range(6, 12):
        at_s = NOW_S + minute * SETTLED_S / 2
        report(of, named(f"M{minute}", 30), at_s)
    assert sum(of.owners.admission.waiting.values()) > 0, f"{STARTS_S:g} s are over"


@pytest.mark.parametrize("fast", [False, True])
def test_a_burst_beside_a_known_floor_is_examined_at_a_limited_rate_in_order_of_arrival(fast: bool) -> None:
    of, burst = known_floor(), named("N", 100)
    if fast:
        of.use(load())
    for second in range(181):
        at_s = KNOWN_S + second
        report(of, [*named("K", 5), *burst], at_s)
        of.next_batch(at_s)
        known = [name for name in burst if of.robots[robot(name)].examined]
        assert known == burst[: 20 * (1 + second // 60)]
    assert all(of.robots[robot(name)].examined for name in named("K", 5)), "nobody is pushed out"


def test_a_robot_that_is_examined_later_is_in_the_next_batch() -> None:
    of = known_floor()
    report(of, named("N", 21), KNOWN_S)
    assert of.next_batch(KNOWN_S).examined.tolist() == [True] * 25 + [False]
    report(of, ["N-20"], KNOWN_S + MINUTE_S)
    batch = of.next_batch(KNOWN_S + MINUTE_S)
    assert batch.robots == (robot("N-20"),)
    assert batch.examined.tolist() == [True]


def test_a_large_fleet_may_grow_by_a_share_of_itself() -> None:
    of = known_floor(1000)
    report(of, named("N", 100), KNOWN_S)
    assert examined(of) == 1050


def test_the_burst_of_one_source_takes_no_place_of_another() -> None:
    of = known_floor()
    report(of, named("N", 100), KNOWN_S)
    report(of, named("T", 20), KNOWN_S, THERE)
    assert all(of.robots[robot(name)].examined for name in named("T", 20))


@pytest.mark.parametrize(
    ("connection", "vendor"),
    [
        (Connection(3, "10.0.0.3", vendor="Alder", proven=True), Vendor(name="Alder")),
        (HERE, Vendor(name="Alder", robots=tuple(robot(name) for name in named("N", 100)))),
    ],
    ids=["proven", "named"],
)
def test_robots_of_who_is_proven_and_robots_that_the_site_file_names_are_examined_at_once(
    connection: Connection, vendor: Vendor
) -> None:
    of = known_floor(5, vendor)
    report(of, named("N", 100), KNOWN_S, connection)
    assert examined(of) == 105


def test_a_vendor_that_a_path_claims_proves_nothing() -> None:
    of = known_floor(5, Vendor(name="Alder"), Vendor(name="Basalt"))
    for row, name in enumerate(named("N", 100)):
        of.receive(status(name, KNOWN_S), KNOWN_S, Connection(row, "10.0.0.3", vendor=("Alder", "Basalt")[row % 2]))
    assert examined(of) == 25


def test_makers_that_only_topics_name_share_the_places_of_one_source_also_at_a_start() -> None:
    of = fleet(Vendor(name="KIT"))
    for number in range(300):
        for maker in (f"Maker {number}", "KIT"):
            line = vda_saying.line("state", serial=str(number), maker=maker)
            assert of.receive(vda_saying.state(NOW_S, serial=str(number)), NOW_S, line) is None
    known = [each for each in of.robots.values() if each.examined]
    assert sum(each.vendor == "KIT" for each in known) == 300
    assert len(known) == 320
    assert of.owners.admission.waiting == {"broker broker uagv/v2": 280}


def test_topics_that_name_no_maker_are_like_an_address() -> None:
    of = fleet()
    for hundred, at_s in ((0, NOW_S), (1, KNOWN_S)):
        for number in range(100):
            line = iso_saying.line("odometry", f"91403a21-7534-4467-99a6-{hundred}{number:011d}")
            of.receive(iso_saying.odometry(at_s, 1.0, 1.0, 0.0, 1.0), at_s, line)
    assert examined(of) == 120


def test_so_many_robots_of_a_source_wait_and_further_ones_are_refused() -> None:
    of = known_floor()
    report(of, named("N", 20 + MOST_WAITING + 7), KNOWN_S)
    assert counted(of, "rejections_total") == {("unknown", "robots-too-many"): 7}
    report(of, named("T", 1), KNOWN_S, THERE)
    report(of, named("N", 20 + MOST_WAITING), KNOWN_S + MINUTE_S)
    assert sum(of.owners.admission.waiting.values()) == MOST_WAITING - 20
    reason = of.quarantine.documents()[0]["reason"]
    assert f"{MOST_WAITING} robots of 10.0.0.1 wait" in reason
    assert "site file" in reason


def test_a_robot_that_waits_is_shown_with_the_reason_and_counted() -> None:
    of = known_floor()
    report(of, named("N", 21), KNOWN_S)
    shown = document(of, "N-20", KNOWN_S)
    assert (shown["examined"], shown["source"], shown["floor"] is not None) == (False, "10.0.0.1", True)
    assert "10.0.0.1" in shown["unexamined_reason"]
    assert document(of, "N-0", KNOWN_S)["unexamined_reason"] is None
    fleet_report.measure(of, KNOWN_S)
    assert of.measures.values[UNEXAMINED] == {("10.0.0.1",): 1}


def test_who_reports_over_a_socket_is_not_advised_to_name_a_manufacturer_since_that_does_not_help() -> None:
    of = known_floor(25, Vendor(name="Alder", manufacturers=("Alder",), robots=(robot("L-1"),)))
    for name in named("N", 25):
        of.receive(identity(name, KNOWN_S), KNOWN_S, HERE)
    report(of, named("N", 25), KNOWN_S)
    report(of, ["L-1"], KNOWN_S)
    waiting = document(of, "N-24", KNOWN_S)
    assert (waiting["vendor"], waiting["examined"]) == ("Alder", False), "its manufacturer is named"
    assert "manufacturer" not in waiting["unexamined_reason"]
    assert "vendors.robots" in waiting["unexamined_reason"]
    assert document(of, "L-1", KNOWN_S)["examined"] is True, "what is advised helps"


def test_the_advice_on_a_broker_is_to_name_the_manufacturer_and_on_several_sources_says_which() -> None:
    topics, socket = "broker hall uagv/v2", "10.0.0.1"
    assert "manufacturer" in remedy([topics])
    assert "token" not in remedy([topics])
    assert "manufacturer" not in remedy([socket])
    assert remedy([topics, socket]) == f"of a broker, {remedy([topics])}; of others, {remedy([socket])}"


def test_the_sources_with_most_are_named_and_the_rest_counted_together() -> None:
    of = known_floor()
    for number in range(MOST_NAMED + 2):
        report(of, named(f"N{number}", 22 if number < 2 else 23), KNOWN_S, Connection(number, f"10.0.1.{number}"))
    level = of.owners.admission.level()
    assert len(level) == MOST_NAMED + 1
    assert level[(OTHERS,)] == 4


def test_a_robot_that_is_forgotten_waits_no_more() -> None:
    of = known_floor()
    report(of, named("N", 30), KNOWN_S)
    later_s = KNOWN_S + of.reading.forget_after_s + 1
    of.next_batch(later_s)
    assert not of.owners.admission.waiting
    assert of.owners.admission.examined == 0


def test_an_identity_that_another_ingest_passes_on_gives_no_place() -> None:
    of = known_floor()
    report(of, named("N", 21), KNOWN_S)
    of.receive(identity("N-20", KNOWN_S), KNOWN_S, Connection(9, INTRODUCER))
    assert not of.robots[robot("N-20")].examined
    assert of.owners.admission.waiting == {HERE.source: 1}


def recorded(of: Fleet, directory: Path, names: Iterable[str], at_s: float) -> None:
    """Report, and record as the receiver does."""
    log = Recorder(RecorderSettings(), directory, Measures(), lambda: at_s)
    for name in names:
        for raw in (identity(name, at_s), status(name, at_s)):
            rule = of.receive(raw, at_s, HERE)
            assert of.newest
            log.received(raw, at_s, HERE, rule, waits=not of.newest.examined)
    log.close()


def test_a_replay_examines_what_was_examined_wherever_it_begins(tmp_path: Path) -> None:
    of, again = known_floor(), fleet()
    recorded(of, tmp_path, named("N", 50), KNOWN_S)
    for event in LogReader().read([tmp_path]):
        assert isinstance(event, Received)
        again.receive_recorded(event)
    assert {uuid for uuid, each in again.robots.items() if each.examined} == {robot(name) for name in named("N", 20)}
    assert again.owners.admission.waiting == of.owners.admission.waiting


def test_a_restart_examines_who_was_examined_and_is_no_start(tmp_path: Path) -> None:
    of, again, log = known_floor(), fleet(), tmp_path / "log"
    recorded(of, log, [*named("K", 5), *named("N", 50)], KNOWN_S)
    kept = kept_of(of, tmp_path)
    kept.write(KNOWN_S + 1, KNOWN_S + 1)
    recover(again, [log], KNOWN_S + 5, kept=kept_of(again, tmp_path).read(KNOWN_S + 5))
    assert {uuid for uuid, each in again.robots.items() if each.examined} == {
        robot(name) for name in [*named("K", 5), *named("N", 20)]
    }
    report(again, named("M", 40), KNOWN_S + 6, THERE)
    assert examined(again) == 45


def test_an_identity_that_waited_is_kept_once_its_robot_is_examined(tmp_path: Path) -> None:
    of = known_floor()
    kept = kept_of(of, tmp_path)
    for name in named("N", 21):
        of.receive(identity(name, KNOWN_S), KNOWN_S, HERE)
    kept.write(KNOWN_S, KNOWN_S)
    assert len(rows(tmp_path)) == 20
    report(of, ["N-20"], KNOWN_S + MINUTE_S)
    kept.write(KNOWN_S, KNOWN_S + MINUTE_S)
    assert len(rows(tmp_path)) == 21
