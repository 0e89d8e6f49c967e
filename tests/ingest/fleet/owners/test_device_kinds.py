"""What a device stands for is what the site file says of its UUID, its model or its vendor, and nothing else."""

import pytest

from deconflict_client.participant_kinds import ParticipantKind
from ingest.fleet.fleet import Fleet
from ingest.fleet.fleet_report import robot_document
from ingest.fleet.owners.device_kinds import has_only_people, participant_of
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Model, Reading, Vendor
from tests.helpers.saying import identity, robot, status

NOW_S = 1_790_000_000.0
LINE = Connection(1)
MIXED = Vendor(
    name="Alder",
    participant="driven",
    models={"Vest": Model(participant="person"), "Truck": Model()},
    participants={"person": ("AAAA-1", "bb*"), "robot": ("aaaa*", "bbb*")},
)


@pytest.mark.parametrize(
    ("model", "uuid", "kind"),
    [
        ("", "cccc-1", "driven"),
        ("Truck", "cccc-1", "driven"),
        ("Vest", "cccc-1", "person"),
        ("Vest", "aaaa-2", "robot"),
        ("Vest", "aaaa-1", "person"),
        ("Truck", "bbb", "robot"),
        ("Truck", "bb-1", "person"),
    ],
)
def test_the_uuid_comes_before_its_beginning_that_before_the_model_and_that_before_the_vendor(
    model: str, uuid: str, kind: ParticipantKind
) -> None:
    assert participant_of(MIXED, model, uuid) == kind


@pytest.mark.parametrize(
    ("vendor", "only_people"),
    [
        (Vendor(name="Alder", participant="person"), True),
        (Vendor(name="Alder", participant="person", models={"Vest": Model()}), True),
        (Vendor(name="Alder", participant="person", models={"Truck": Model(participant="driven")}), False),
        (Vendor(name="Alder", participant="person", participants={"robot": ("a*",)}), False),
        (Vendor(name="Alder", models={"Vest": Model(participant="person")}), False),
    ],
)
def test_a_vendor_has_only_people_if_nothing_says_otherwise(vendor: Vendor, only_people: bool) -> None:
    assert has_only_people(vendor) is only_people


def kinds(fleet: Fleet) -> dict[str, str]:
    batch = fleet.next_batch(NOW_S, everything=True)
    shown = {uuid: robot_document(fleet, known, NOW_S)["participant"] for uuid, known in fleet.robots.items()}
    assert shown == dict(zip(batch.robots, batch.participants, strict=True))
    return shown


def fleet_of_vendor(vendor: Vendor) -> Fleet:
    return Fleet(VendorRegistry([vendor]), FrameRegistry((), (vendor,)), Reading(), Measures(), Quarantine())


def test_devices_of_one_vendor_stand_for_robots_people_and_vehicles_and_a_reload_changes_it_at_once() -> None:
    before = Vendor(name="Alder", models={"Vest": Model(participant="person")})
    fleet, (a, b, c) = fleet_of_vendor(before), map(robot, "ABC")
    for name, model in (("A", "Vest"), ("B", "Truck"), ("C", "Flat")):
        fleet.receive(identity(name, NOW_S, robotModel=model), NOW_S, LINE)
        fleet.receive(status(name, NOW_S), NOW_S, LINE)
    assert kinds(fleet) == {a: "person", b: "robot", c: "robot"}
    after = Vendor(
        name="Alder", models={"Truck": Model(participant="driven")}, participants={"person": (f"{c[:30]}*",)}
    )
    fleet.reconfigure(VendorRegistry([after]), FrameRegistry((), (after,)), Reading())
    assert kinds(fleet) == {a: "robot", b: "driven", c: "person"}


def test_a_kind_by_model_waits_for_the_identity_report() -> None:
    fleet = fleet_of_vendor(Vendor(name="Alder", robots=(robot("A"),), models={"Vest": Model(participant="person")}))
    fleet.receive(status("A", NOW_S), NOW_S, LINE)
    assert kinds(fleet) == {robot("A"): "robot"}
    fleet.receive(identity("A", NOW_S + 1, robotModel="Vest"), NOW_S + 1, LINE)
    assert kinds(fleet) == {robot("A"): "person"}
