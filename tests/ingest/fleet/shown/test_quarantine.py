from ingest.fleet.shown.quarantine import (
    KEPT_BYTES,
    KEPT_PER_VENDOR,
    MOST_ADDRESSES,
    MOST_VENDORS,
    Quarantine,
    rejected_message,
)
from ingest.languages.model import Rejection
from ingest.languages.rules import Oddity
from ingest.settings import UNKNOWN


def add(to: Quarantine, vendor: str, arrival_s: float, raw: bytes = b"{", address: str = "10.0.0.1") -> None:
    to.add(rejected_message(raw, Rejection("not-json", "send JSON"), 1, arrival_s), vendor, address)


def test_a_rejected_message_is_kept_with_what_a_person_needs() -> None:
    quarantine = Quarantine()
    add(quarantine, "Alder", 1_790_000_000.0, b"\xffoops")
    assert quarantine.documents() == [
        {
            "received": "2026-09-21T14:13:20.000000Z",
            "vendor": "Alder",
            "connection": 1,
            "rule": "not-json",
            "reason": "send JSON",
            "message": "\\xffoops",
            "size_bytes": 5,
            "cut_short": False,
            "odd_values": [],
        }
    ]


def test_a_rejected_message_keeps_the_values_that_deviate() -> None:
    quarantine, odd = Quarantine(), Oddity("key-unknown", "locaton", "{}", "not read", "location")
    rejection = Rejection("key-missing", "send a location", oddities=(odd,))
    quarantine.add(rejected_message(b"{}", rejection, 1, 1.0), "Alder", "10.0.0.1")
    (document,) = quarantine.documents()
    assert document["odd_values"] == [odd._asdict()]


def test_many_rejected_messages_of_one_vendor_do_not_displace_those_of_others() -> None:
    quarantine = Quarantine()
    add(quarantine, "Alder", 1.0)
    for i in range(1000):
        add(quarantine, "Corvid", 2.0 + i)
    kept = [document["vendor"] for document in quarantine.documents()]
    assert kept.count("Alder") == 1
    assert kept.count("Corvid") == KEPT_PER_VENDOR
    assert quarantine.displaced == 1000 - KEPT_PER_VENDOR
    assert quarantine.documents()[0]["received"].startswith("1970-01-01T00:16:41")


def test_a_long_message_is_cut_and_says_so() -> None:
    quarantine = Quarantine()
    add(quarantine, "Alder", 1.0, b"x" * 50_000)
    (document,) = quarantine.documents()
    assert (len(document["message"]), document["size_bytes"], document["cut_short"]) == (KEPT_BYTES, 50_000, True)


def test_vendors_are_bounded() -> None:
    quarantine = Quarantine()
    for i in range(2 * MOST_VENDORS):
        add(quarantine, f"V{i}", 1.0)
    assert len(quarantine.documents()) == MOST_VENDORS
    assert quarantine.displaced == MOST_VENDORS


def test_many_rejected_messages_of_one_address_without_a_vendor_do_not_displace_those_of_others() -> None:
    quarantine = Quarantine()
    add(quarantine, UNKNOWN, 1.0, b"of another", "10.0.0.1")
    for i in range(1000):
        add(quarantine, UNKNOWN, 2.0 + i, address="10.0.0.2")
    assert [document["message"] for document in quarantine.documents()].count("of another") == 1


def test_addresses_are_bounded_and_displace_no_vendor() -> None:
    quarantine = Quarantine()
    add(quarantine, "Alder", 1.0, b"of a vendor")
    for i in range(3 * MOST_ADDRESSES):
        add(quarantine, UNKNOWN, 2.0 + i, address=f"2001:db8::{i:x}")
    kept = [document["message"] for document in quarantine.documents()]
    assert (len(kept), kept.count("of a vendor")) == (MOST_ADDRESSES + 1, 1)
    assert quarantine.displaced == 2 * MOST_ADDRESSES
