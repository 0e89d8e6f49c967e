"""Whose a robot is, over silence, a restart, a crowd of invented robots and another site file."""

import asyncio
import json
from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import Fault, blocked, without_its_disk
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners import owner_register
from ingest.fleet.owners.owner_file import FAILURES, FILE_NAME, FORGOTTEN, OwnerFile
from ingest.fleet.owners.owner_register import OwnerRegister
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Reading, Vendor
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import NOW_S, document, documents, fleet

ALDER, BASALT = Vendor(name="Alder"), Vendor(name="Basalt")
FROM_ALDER, FROM_BASALT = Connection(1, vendor="Alder"), Connection(2, vendor="Basalt")
REFUSED = "uuid-of-another-vendor"


def restarted(before: Fleet, directory: Path, *vendors: Vendor) -> Fleet:
    """A fleet that has the register of another one, and none of its robots."""
    OwnerFile(directory, before.owners, before.measures).write()
    after = fleet(*vendors)
    OwnerFile(directory, after.owners, after.measures)
    return after


def test_a_robot_that_was_forgotten_stays_its_vendors() -> None:
    receiving_fleet = fleet(ALDER, BASALT, forget_after_s=60.0)
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    receiving_fleet.next_batch(NOW_S + 100)
    assert not receiving_fleet.robots
    assert receiving_fleet.receive(status("A-1", NOW_S + 101), NOW_S + 101, FROM_BASALT) == REFUSED
    assert receiving_fleet.receive(status("A-1", NOW_S + 101), NOW_S + 101, FROM_ALDER) is None


@pytest.mark.parametrize("message", [status, identity])
def test_a_robot_stays_its_vendors_over_a_restart_however_long_it_is_silent(tmp_path: Path, message) -> None:  # type: ignore[no-untyped-def]
    before = fleet(ALDER, BASALT)
    before.receive(message("A-1", NOW_S), NOW_S, FROM_ALDER)
    after = restarted(before, tmp_path, ALDER, BASALT)
    late_s = NOW_S + 1e6
    assert after.receive(status("A-1", late_s), late_s, FROM_BASALT) == REFUSED
    assert after.receive(status("A-1", late_s), late_s, FROM_ALDER) is None


def test_a_vendor_that_the_site_file_removed_owns_nothing_any_more(tmp_path: Path) -> None:
    before = fleet(ALDER, BASALT)
    before.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    assert restarted(before, tmp_path, BASALT).receive(status("A-1", NOW_S), NOW_S, FROM_BASALT) is None
    before.next_batch(NOW_S + 1e6)
    before.reconfigure(VendorRegistry((BASALT,)), FrameRegistry((), (BASALT,)), Reading())
    assert before.receive(status("A-1", NOW_S), NOW_S + 1e6, FROM_BASALT) is None


def test_a_manufacturer_that_becomes_a_vendor_keeps_its_robots(tmp_path: Path) -> None:
    before = fleet(BASALT)
    before.receive(identity("A-1", NOW_S, manufacturerName="Alder Robotics"), NOW_S, Connection(1))
    named = Vendor(name="Alder", manufacturers=("Alder Robotics",))
    after = restarted(before, tmp_path, named, BASALT)
    assert after.receive(status("A-1", NOW_S), NOW_S, FROM_BASALT) == REFUSED
    assert after.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER) is None


def test_a_name_that_only_an_identity_report_gives_keeps_no_robot_from_a_vendor_of_the_site(tmp_path: Path) -> None:
    before = fleet(ALDER)
    before.receive(identity("A-1", NOW_S, manufacturerName="Nobody"), NOW_S, Connection(1))
    after = restarted(before, tmp_path, ALDER)
    assert after.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER) is None


def test_a_robot_that_is_given_to_a_vendor_begins_anew_as_its_own() -> None:
    receiving_fleet = fleet(ALDER, BASALT)
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, FROM_BASALT)
    receiving_fleet.next_batch(NOW_S)
    assert receiving_fleet.owners.vendors.problem_of_giving(robot("A-1"), "Alder") == ""
    receiving_fleet.give(robot("A-1"), "Alder")
    assert list(receiving_fleet.next_batch(NOW_S + 1).gone) == [robot("A-1")]
    assert receiving_fleet.receive(status("A-1", NOW_S + 1), NOW_S + 1, FROM_BASALT) == REFUSED
    assert receiving_fleet.receive(status("A-1", NOW_S + 1), NOW_S + 1, FROM_ALDER) is None
    assert document(receiving_fleet, "A-1")["vendor"] == "Alder"


def test_a_robot_of_the_site_file_is_not_given_away_and_none_to_an_unknown_vendor() -> None:
    receiving_fleet = fleet(ALDER, Vendor(name="Basalt", robots=(robot("B-1"),)))
    assert "change vendors.robots" in receiving_fleet.owners.vendors.problem_of_giving(robot("B-1"), "Alder")
    assert "in no site file" in receiving_fleet.owners.vendors.problem_of_giving(robot("A-1"), "Nobody")


def test_nobody_can_take_the_uuid_of_a_robot_that_its_vendor_will_name() -> None:
    receiving_fleet = fleet(Vendor(name="Alder", names_as_uuid=True), BASALT)
    receiving_fleet.receive(status("A-1", NOW_S, uuid="cart 7"), NOW_S, FROM_ALDER)
    (derived,) = receiving_fleet.robots

    squatted = fleet(Vendor(name="Alder", names_as_uuid=True), BASALT)
    assert squatted.receive(status("B-1", NOW_S, uuid=derived), NOW_S, FROM_BASALT) is None
    assert squatted.receive(status("A-1", NOW_S + 1, uuid="cart 7"), NOW_S + 1, FROM_ALDER) is None
    assert [each["vendor"] for each in documents(squatted)] == ["Alder"]
    assert squatted.receive(status("B-1", NOW_S + 2, uuid=derived), NOW_S + 2, FROM_BASALT) == REFUSED


def test_the_site_file_outranks_a_name() -> None:
    receiving_fleet = fleet(Vendor(name="Alder", names_as_uuid=True), BASALT)
    receiving_fleet.receive(status("A-1", NOW_S, uuid="cart 7"), NOW_S, FROM_ALDER)
    (derived,) = receiving_fleet.robots
    assigned = fleet(Vendor(name="Alder", names_as_uuid=True), Vendor(name="Basalt", robots=(derived,)))
    assert assigned.receive(status("A-1", NOW_S, uuid="cart 7"), NOW_S, FROM_ALDER) == REFUSED


def test_invented_robots_of_a_vendor_displace_those_of_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(owner_register, "MOST_OWNED", 3)
    receiving_fleet = fleet(ALDER, BASALT)
    receiving_fleet.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    for number in range(6):
        receiving_fleet.receive(status(f"B-{number}", NOW_S), NOW_S, FROM_BASALT)
    register = receiving_fleet.owners.register
    assert [register.owner(robot(f"B-{number}")) for number in range(6)] == [None] * 3 + ["Basalt"] * 3
    assert register.owner(robot("A-1")) == "Alder"
    file = OwnerFile(tmp_path, receiving_fleet.owners, receiving_fleet.measures)
    file._count_forgotten()
    assert receiving_fleet.measures.values[FORGOTTEN] == {("Basalt",): 3}


def test_vendors_that_only_messages_name_share_the_room_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner_register, "MOST_OWNED", 3)
    receiving_fleet = fleet(ALDER)
    for number in range(3):
        receiving_fleet.receive(status(f"A-{number}", NOW_S), NOW_S, FROM_ALDER)
    for number in range(6):
        maker = f"Invented {number // 2}"
        receiving_fleet.receive(identity(f"I-{number}", NOW_S, manufacturerName=maker), NOW_S, Connection(1))
    register = receiving_fleet.owners.register
    assert [register.owner(robot(f"A-{number}")) for number in range(3)] == ["Alder"] * 3
    kept = [register.owner(robot(f"I-{number}")) for number in range(6)]
    assert kept == [None, None, None, "Invented 1", "Invented 2", "Invented 2"]
    assert register.forgotten == {"Invented 0": 2, "Invented 1": 1}


def test_of_vendors_that_share_their_room_the_oldest_robots_are_forgotten_also_after_a_restart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(owner_register, "MOST_OWNED", 4)
    vendors = VendorRegistry((ALDER,))
    before, after = OwnerRegister(vendors.configured), OwnerRegister(vendors.configured)
    for uuid, vendor in (("a", "I 1"), ("b", "Honest"), ("c", "I 2"), ("d", "Honest"), ("a", "I 1")):
        before.enter(uuid, vendor)
    after.read(json.dumps(before.document(vendors)).encode(), vendors)
    for register in (before, after):
        register.enter("e", "I 3")
        register.enter("f", "I 4")
        assert [register.owner(uuid) for uuid in "abcdef"] == ["I 1", None, None, "Honest", "I 3", "I 4"]


def test_a_vendor_that_the_site_file_begins_to_name_shares_its_room_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner_register, "MOST_OWNED", 2)
    configured: set[str] = set()
    register = OwnerRegister(configured.__contains__)
    register.enter("a", "Alder")
    configured.add("Alder")
    register.settle(lambda vendor: vendor)
    for number in range(3):
        register.enter(f"i {number}", "Invented")
    assert [register.owner(uuid) for uuid in ("a", "i 0", "i 1")] == ["Alder", None, "Invented"]


def test_an_entry_looks_at_the_name_of_its_own_vendor_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner_register, "MOST_OWNED", 3)
    looked_at: list[str] = []

    def is_configured(vendor: str) -> bool:
        looked_at.append(vendor)
        return False

    register = OwnerRegister(is_configured)
    for number in range(10):
        register.enter(f"i {number}", f"Invented {number}")
    assert looked_at == [f"Invented {number}" for number in range(10)]


class ComparedName(str):
    """The name of a vendor that counts how often it is compared."""

    comparisons = 0

    def __eq__(self, other: object) -> bool:
        ComparedName.comparisons += 1
        return super().__eq__(other)

    __hash__ = str.__hash__


def test_a_new_robot_of_a_vendor_at_its_limit_costs_no_look_at_robots_of_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(owner_register, "MOST_OWNED", 3)
    register, full = OwnerRegister(lambda _: True), ComparedName("Basalt")
    for number in range(100):
        register.enter(f"other {number}", f"Alder {number}")
    for number in range(4):
        register.enter(f"own {number}", full)
    assert register.forgotten == {"Basalt": 1}
    assert ComparedName.comparisons < 20


def test_robots_that_were_entered_longest_ago_are_forgotten_first_also_after_a_restart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(owner_register, "MOST_OWNED", 3)
    vendors = VendorRegistry((ALDER, BASALT))
    before, after = OwnerRegister(vendors.configured), OwnerRegister(vendors.configured)
    for uuid, vendor in (("a", "Alder"), ("b", "Basalt"), ("c", "Alder"), ("d", "Alder"), ("a", "Alder")):
        before.enter(uuid, vendor)
    after.read(json.dumps(before.document(vendors)).encode(), vendors)
    for register in (before, after):
        register.enter("e", "Alder")
        assert [register.owner(uuid) for uuid in "abcde"] == ["Alder", "Basalt", None, "Alder", "Alder"]


@pytest.mark.parametrize("content", [b"", b"[]", b'{"format": 2}', b'{"format": 1, "owners": [["a"]]}', b"[" * 100_000])
def test_an_unreadable_register_is_set_aside_and_counted(
    tmp_path: Path, content: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / FILE_NAME).write_bytes(content)
    receiving_fleet = fleet(ALDER)
    OwnerFile(tmp_path, receiving_fleet.owners, measures := Measures())
    assert measures.values[FAILURES]["read",] == 1
    assert "set aside" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == [f"{FILE_NAME}.unreadable"]


def test_a_register_that_cannot_be_written_is_counted_and_written_later(tmp_path: Path) -> None:
    directory = tmp_path / "data"
    directory.mkdir()
    owners = fleet(ALDER).owners
    file = OwnerFile(directory, owners, measures := Measures())
    owners.register.enter(robot("A-1"), "Alder")
    directory.rmdir()
    file.write()
    assert measures.values[FAILURES]["write",] == 1
    directory.mkdir()
    file.write()
    vendors = VendorRegistry((ALDER,))
    again = OwnerRegister(vendors.configured)
    again.read((directory / FILE_NAME).read_bytes(), vendors)
    assert again.owner(robot("A-1")) == "Alder"


@pytest.mark.parametrize("fault", [blocked, without_its_disk])
async def test_a_file_that_cannot_be_read_for_a_while_is_not_replaced_and_counts_more_once_it_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: Fault
) -> None:
    monkeypatch.setattr("ingest.fleet.owners.owner_file.WRITE_EVERY_S", 0.05)
    before, data = fleet(ALDER, BASALT), tmp_path / "data"
    data.mkdir()
    before.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    OwnerFile(data, before.owners, before.measures).write()
    after = fleet(ALDER, BASALT)
    with fault(data / FILE_NAME):
        file = OwnerFile(data, after.owners, after.measures)
        after.receive(status("A-1", NOW_S + 1), NOW_S + 1, FROM_BASALT)
        after.receive(status("B-1", NOW_S + 1), NOW_S + 1, FROM_BASALT)
        file.write()
        assert after.measures.values[FAILURES] == {("read",): 1, ("write",): 0}
    keeping = asyncio.create_task(file.keep())
    async with asyncio.timeout(PATIENCE_S):
        while b"Basalt" not in (data / FILE_NAME).read_bytes():
            await asyncio.sleep(0.01)
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
    again = fleet(ALDER, BASALT)
    OwnerFile(data, again.owners, again.measures)
    owner = again.owners.register.owner
    assert (owner(robot("A-1")), owner(robot("B-1"))) == ("Alder", "Basalt")


async def test_a_file_that_is_removed_while_the_service_runs_is_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.fleet.owners.owner_file.WRITE_EVERY_S", 0.05)
    here = fleet(ALDER)
    here.receive(status("A-1", NOW_S), NOW_S, FROM_ALDER)
    file = OwnerFile(tmp_path, here.owners, here.measures)
    file.write()
    (tmp_path / FILE_NAME).unlink()
    keeping = asyncio.create_task(file.keep())
    async with asyncio.timeout(PATIENCE_S):
        while not (tmp_path / FILE_NAME).exists():
            await asyncio.sleep(0.01)
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
    assert b"Alder" in (tmp_path / FILE_NAME).read_bytes()
