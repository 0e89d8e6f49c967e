"""Whose a robot is, and who may speak of it."""

from ingest.port.connection import Connection
from ingest.settings import UNKNOWN, Vendor
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, counted, document, fleet


def test_an_unidentified_robot_belongs_to_the_only_vendor_on_its_connection() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    receiving_fleet.receive(status("A-2", NOW_S), NOW_S, LINE)
    assert document(receiving_fleet, "A-2")["vendor"] == "Alder"


def test_a_robot_that_its_vendor_spoke_for_is_refused_from_another() -> None:
    receiving_fleet = fleet(Vendor(name="Alder"), Vendor(name="Basalt"))
    alder, basalt = Connection(1, vendor="Alder"), Connection(2, vendor="Basalt")
    receiving_fleet.receive(status("A-1", NOW_S, 3.0), NOW_S, alder)
    for forged in (status("A-1", NOW_S + 1, 90.0), identity("A-1", NOW_S + 1, manufacturerName="Basalt")):
        assert receiving_fleet.receive(forged, NOW_S + 1, basalt) == "uuid-of-another-vendor"
    receiving_fleet.receive(status("A-1", NOW_S + 1, location=None), NOW_S + 1, basalt)
    assert counted(receiving_fleet, "rejections_total") == {
        ("Basalt", "uuid-of-another-vendor"): 2,
        ("Basalt", "key-missing"): 1,
    }
    assert document(receiving_fleet, "A-1")["vendor"] == "Alder"
    assert receiving_fleet.next_batch(NOW_S + 1).forecasts.x_m[0] == 3.0
    assert receiving_fleet.receive(status("A-1", NOW_S + 2, 5.0), NOW_S + 2, alder) is None


def test_a_robot_that_identified_itself_cannot_become_another_makers() -> None:
    receiving_fleet = fleet()
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    renamed = identity("A-1", NOW_S + 1, manufacturerName="Basalt")
    assert receiving_fleet.receive(renamed, NOW_S + 1, Connection(2)) == "uuid-of-another-vendor"
    assert document(receiving_fleet, "A-1")["vendor"] == "Alder"


def test_a_vendors_own_connection_settles_the_owner_of_an_unidentified_robot() -> None:
    receiving_fleet = fleet(Vendor(name="Basalt"))
    receiving_fleet.receive(status("B-1", NOW_S), NOW_S, LINE)
    assert document(receiving_fleet, "B-1")["vendor"] == UNKNOWN
    receiving_fleet.receive(status("B-1", NOW_S + 1), NOW_S + 1, Connection(2, vendor="Basalt"))
    assert document(receiving_fleet, "B-1")["vendor"] == "Basalt"


def test_the_site_gives_a_robot_to_one_vendor_and_refuses_it_from_another() -> None:
    receiving_fleet = fleet(Vendor(name="Alder"), Vendor(name="Basalt", robots=(robot("A-1"),)))
    alder = Connection(1, vendor="Alder")
    assert receiving_fleet.receive(status("A-1", NOW_S), NOW_S, alder) == "uuid-of-another-vendor"
    assert receiving_fleet.receive(status("A-1", NOW_S), NOW_S, Connection(2, vendor="Basalt")) is None


def test_the_site_file_may_name_the_owner_of_a_robot() -> None:
    receiving_fleet = fleet(Vendor(name="Basalt", robots=(robot("A-1").upper(),)))
    receiving_fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    assert document(receiving_fleet, "A-1")["vendor"] == "Basalt"
