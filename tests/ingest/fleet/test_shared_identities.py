"""What robots say of themselves, as one ingest hands it to another."""

from dataclasses import replace

from ingest.fleet.fleet_report import add_identity, lacks, shared_identities
from ingest.fleet.shared_identities import SharedIdentity
from ingest.port.connection import Connection
from ingest.settings import Vendor
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, document, fleet

ELSEWHERE = SharedIdentity(robot("A-1"), identity("A-1", NOW_S), NOW_S, None, "Alder", elsewhere=True)
LARGER = replace(ELSEWHERE, raw=identity("A-1", NOW_S, baseRobotEnvelope={"x": 2.0, "y": 1.0}), arrival_s=NOW_S + 1)


def test_introductions_after_a_time_come_in_their_order() -> None:
    receiving_fleet = fleet(Vendor(name="Alder"))
    receiving_fleet.receive(identity("A-2", NOW_S), NOW_S + 2, Connection(2, vendor="Alder"))
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S + 1, LINE)
    receiving_fleet.receive(status("A-3", NOW_S), NOW_S + 3, LINE)
    identities = shared_identities(receiving_fleet, NOW_S)
    assert [(each.uuid, each.arrival_s, each.vendor, each.owner) for each in identities] == [
        (robot("A-1"), NOW_S + 1, None, "Alder"),
        (robot("A-2"), NOW_S + 2, "Alder", "Alder"),
    ]
    assert identities[0].raw == identity("A-1", NOW_S)
    assert shared_identities(receiving_fleet, NOW_S + 1) == identities[1:]


def test_an_introduction_survives_its_document_whatever_its_bytes() -> None:
    odd = SharedIdentity(robot("A-1"), b"\xff\xfe\n{", 1.25, "Alder", "Basalt", assigned=True)
    assert SharedIdentity.of_document(odd.document()) == odd


def test_an_unidentified_robot_lacks_an_introduction_until_it_is_introduced() -> None:
    receiving_fleet = fleet()
    assert not lacks(receiving_fleet, ELSEWHERE)
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, LINE)
    assert lacks(receiving_fleet, ELSEWHERE)
    assert add_identity(receiving_fleet, ELSEWHERE, NOW_S + 5, Connection(7)) is None
    shown = document(receiving_fleet, "A-1")
    assert (shown["identified"], shown["name"], shown["envelope"]["length_m"]) == (True, "Alder A-1", 1.0)
    assert not lacks(receiving_fleet, ELSEWHERE)
    assert not shared_identities(receiving_fleet, NOW_S - 1), "the receiver that heard it sends it"


def test_a_later_introduction_from_elsewhere_is_lacking_even_if_an_earlier_one_arrives_here_after_it() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, LINE)
    add_identity(receiving_fleet, ELSEWHERE, NOW_S + 5, Connection(7))
    assert lacks(receiving_fleet, LARGER)
    add_identity(receiving_fleet, LARGER, NOW_S + 6, Connection(8))
    assert document(receiving_fleet, "A-1")["envelope"]["length_m"] == 2.0
    assert not lacks(receiving_fleet, ELSEWHERE)
    assert not lacks(receiving_fleet, replace(LARGER, arrival_s=NOW_S + 9))


def test_an_introduction_to_another_vendors_robot_is_refused() -> None:
    receiving_fleet = fleet(Vendor(name="Basalt"))
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, Connection(1, vendor="Basalt"))
    assert add_identity(receiving_fleet, ELSEWHERE, NOW_S + 1, Connection(7)) == "uuid-of-another-vendor"
    assert lacks(receiving_fleet, ELSEWHERE)


def test_another_vendors_introduction_is_no_news_unless_the_site_file_assigns_it_the_robot() -> None:
    taken = replace(LARGER, owner="Basalt")
    assert not taken.is_news_to(ELSEWHERE)
    assert replace(taken, assigned=True).is_news_to(ELSEWHERE)
    receiving_fleet = fleet(Vendor(name="Basalt", robots=(robot("A-1"),)))
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    (introduction,) = shared_identities(receiving_fleet, NOW_S - 1)
    assert (introduction.owner, introduction.assigned) == ("Basalt", True)
