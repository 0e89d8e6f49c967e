import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.port.connection import Connection
from ingest.port.rate_limits import (
    MOST_BUCKETS,
    MOST_IN_HAND_S,
    MOST_WAITING_BYTES,
    OVERHEAD_BYTES,
    USUAL_S_PER_BYTE,
    ArrivedMessage,
    RateLimits,
    Rates,
)
from tests.helpers.saying import identity, status

ALDER, BASALT = Connection(1, vendor="Alder"), Connection(2, vendor="Basalt")


def arrived(raw: bytes, t_s: float = 0.0, connection: Connection = ALDER) -> ArrivedMessage:
    return ArrivedMessage(raw, t_s, connection)


def at_once(shares: RateLimits, vendor: str, arrived_message: ArrivedMessage, now_s: float) -> bool:
    return shares.admit(vendor, arrived_message, now_s)[0]


def test_a_vendor_within_its_share_never_waits() -> None:
    shares = RateLimits(Rates(10.0))
    assert all(at_once(shares, "Alder", arrived(b"{}"), i / 10) for i in range(100))
    assert not shares.waiting


def test_a_flood_waits_and_another_vendor_does_not() -> None:
    shares = RateLimits(Rates(10.0))
    taken = sum(at_once(shares, "Alder", arrived(status(f"A-{i}", 0.0)), 0.0) for i in range(1000))
    assert taken == 10
    assert at_once(shares, "Basalt", arrived(status("B-1", 0.0), connection=BASALT), 0.0)


def test_the_newest_of_each_robot_waits_and_what_it_overtakes_is_shed() -> None:
    shares = RateLimits(Rates(1.0))
    shares.admit("Alder", arrived(b"first"), 0.0)
    older, other, newer = (arrived(status(name, t)) for name, t in (("A-1", 1.0), ("A-2", 1.0), ("A-1", 2.0)))
    assert shares.admit("Alder", older, 0.0) == (False, [])
    assert shares.admit("Alder", other, 0.0) == (False, [])
    assert shares.admit("Alder", newer, 0.0) == (False, [older])
    assert shares.due(0.5) == []
    assert shares.due(1.0) == [newer]
    assert shares.due(2.0) == [other]


def test_an_identity_is_not_overtaken_by_a_status() -> None:
    shares = RateLimits(Rates(1.0))
    shares.admit("Alder", arrived(b"first"), 0.0)
    assert shares.admit("Alder", arrived(identity("A-1", 0.0)), 0.0) == (False, [])
    assert shares.admit("Alder", arrived(status("A-1", 0.0)), 0.0) == (False, [])


def test_messages_without_a_uuid_wait_as_one_per_connection() -> None:
    shares = RateLimits(Rates(1.0))
    shares.admit("Alder", arrived(b"first"), 0.0)
    shed = [shares.admit("Alder", arrived(b"no uuid %d" % i), 0.0)[1] for i in range(50)]
    assert [message.raw for each in shed for message in each] == [b"no uuid %d" % i for i in range(49)]


def test_what_waits_is_bounded_by_its_weight_too_and_the_oldest_goes() -> None:
    shares, load = RateLimits(Rates(1.0)), "x" * 60_000
    sent = [arrived(status(f"A-{i}", 0.0, note=load)) for i in range(2 * MOST_WAITING_BYTES // len(load))]
    shed = [gone for message in sent for gone in shares.admit("Alder", message, 0.0)[1]]
    assert shed == sent[1 : len(shed) + 1]
    assert (
        sum(len(message.raw) for message in sent[1 + len(shed) :])
        <= MOST_WAITING_BYTES
        < 1.01 * len(sent[0].raw) * (len(sent) - len(shed))
    )


def test_a_vendor_may_send_a_limited_number_of_bytes_in_a_second() -> None:
    limits = RateLimits(Rates(1000.0, message_bytes=10_000.0))
    sizes = [limits.admit("Alder", arrived(status(f"A-{i}", 0.0, note="x" * 1000)), 0.0)[0] for i in range(20)]
    assert 8 <= sum(sizes) <= 10
    assert 8 <= len(limits.due(1.0)) <= 10
    assert at_once(limits, "Basalt", arrived(status("B-1", 0.0), connection=BASALT), 0.0)


def test_a_vendor_whose_messages_take_long_waits_until_it_has_processor_time_again() -> None:
    limits = RateLimits(Rates(1000.0, processor_s=0.4))
    assert at_once(limits, "Alder", arrived(b"first"), 0.0)
    limits.delivered("Alder", 5, 0.6, 0.0)
    assert not at_once(limits, "Alder", arrived(status("A-1", 0.0)), 0.0)
    assert not at_once(limits, "Alder", arrived(status("A-2", 0.0)), 0.0)
    assert limits.due(0.4) == []
    assert len(limits.due(0.6)) >= 1
    assert at_once(limits, "Basalt", arrived(status("B-1", 0.0), connection=BASALT), 0.0)


def test_messages_that_take_long_are_admitted_a_few_at_a_time() -> None:
    limits, late = RateLimits(Rates(1000.0, message_bytes=1e9)), 0.006
    sent = [arrived(status(f"A-{i}", 0.0, note="x" * 60_000)) for i in range(200)]
    in_hand = [message for message in sent if at_once(limits, "Alder", message, 0.0)]
    most_in_hand = 0
    for step in range(1, 40):
        for message in in_hand:
            limits.delivered("Alder", len(message.raw), late, step * 0.1)
        in_hand = limits.due(step * 0.1)
        most_in_hand = max(most_in_hand, len(in_hand))
    assert 1 <= most_in_hand <= MOST_IN_HAND_S / late + 2


def test_empty_messages_are_admitted_a_limited_number_at_a_time_too() -> None:
    limits = RateLimits(Rates(100_000.0))
    admitted = sum(at_once(limits, "Alder", arrived(b"", connection=Connection(i)), 0.0) for i in range(20_000))
    assert admitted <= MOST_IN_HAND_S / (OVERHEAD_BYTES * USUAL_S_PER_BYTE) + 1


def test_a_vendor_whose_sockets_take_long_is_not_read_for_so_long_that_it_keeps_its_share() -> None:
    limits = RateLimits(Rates(1000.0, reading_s=0.2))
    assert limits.charge_reading("Alder", 0.1, 0.0) == 0.0
    assert limits.charge_reading("Alder", 0.2, 0.0) == pytest.approx(0.5)
    assert limits.charge_reading("Alder", 0.0, 0.5) == pytest.approx(0.0)
    assert limits.charge_reading("Basalt", 0.1, 0.0) == 0.0


def test_addresses_that_come_once_are_forgotten() -> None:
    shares = RateLimits(Rates(10.0))
    for i in range(3 * MOST_BUCKETS):
        shares.admit(f"2001:db8::{i:x}", arrived(b"{}"), i / 10)
        shares.delivered(f"2001:db8::{i:x}", 2, 0.0, i / 10)
    assert len(shares.buckets) <= MOST_BUCKETS


@given(st.lists(st.tuples(st.integers(0, 5), st.floats(0, 0.4)), max_size=200))
def test_every_message_is_taken_shed_or_waiting(sent: list[tuple[int, float]]) -> None:
    shares, now_s, taken, shed = RateLimits(Rates(5.0)), 0.0, 0, 0
    for robot, wait_s in sent:
        now_s += wait_s
        taken += len(shares.due(now_s))
        immediately, overtaken = shares.admit("Alder", arrived(status(f"A-{robot}", now_s)), now_s)
        taken, shed = taken + immediately, shed + len(overtaken)
    assert taken <= 5 + 5 * now_s
    taken += len(shares.due(now_s + 100)) + len(shares.due(now_s + 200))
    assert taken + shed == len(sent)
    assert not shares.waiting
