"""What one sender's rejected messages may fill of the log."""

from collections import Counter
from hashlib import sha256
from pathlib import Path

from ingest.port.connection import Connection
from ingest.recording.log_reader import Received
from ingest.recording.recorder import (
    ALL_BYTES_PER_S,
    BURST_S,
    HEAD_BYTES,
    SENDER_BYTES_PER_S,
    RecordedPart,
    RejectedShares,
)
from tests.helpers.saying import status
from tests.ingest.recording.made_logs import LINE, NOW_S, read, recorder

LONG = b"x" * 60_000


def test_a_sender_of_few_rejected_messages_finds_all_of_them_recorded_whole() -> None:
    shares = RejectedShares()
    assert {shares.admit("Alder", 500, NOW_S + i) for i in range(1000)} == {RecordedPart.WHOLE}


def test_beyond_its_share_a_sender_is_recorded_by_beginnings_and_then_not_at_all_and_others_whole() -> None:
    shares = RejectedShares()
    recorded = [shares.admit("Mallory", len(LONG), NOW_S + i / 1700) for i in range(20_000)]
    assert sorted(Counter(recorded), key=recorded.index) == [
        RecordedPart.WHOLE,
        RecordedPart.HEAD,
        RecordedPart.NOTHING,
    ]
    assert shares.admit("Alder", len(LONG), NOW_S + 12.0) is RecordedPart.WHOLE


def test_a_sender_with_many_addresses_has_a_share_too() -> None:
    shares = RejectedShares()
    recorded = Counter(shares.admit(f"10.0.{i >> 8}.{i & 255}", len(LONG), NOW_S) for i in range(5000))
    assert recorded[RecordedPart.WHOLE] * len(LONG) <= ALL_BYTES_PER_S * BURST_S
    assert recorded[RecordedPart.NOTHING] > 0


def test_a_flood_of_rejected_messages_leaves_the_log_to_others(tmp_path: Path) -> None:
    log, measures = recorder(tmp_path)
    for i in range(20_000):
        log.received(LONG, NOW_S + i / 1700, LINE, "not-json")
    log.received(status("A-1", NOW_S), NOW_S + 12.0, Connection(8, vendor="Borealis"), None)
    log.close()
    written_bytes = sum(path.stat().st_size for path in tmp_path.glob("*"))
    assert written_bytes < 2 * SENDER_BYTES_PER_S * (BURST_S + 12.0) + len(LONG)
    events, unreadable = read(*sorted(tmp_path.glob("*")))
    assert unreadable == 0
    assert isinstance(events[-1], Received)
    assert events[-1].connection.vendor == "Borealis"
    kept = [event.raw for event in events if isinstance(event, Received) and event.refused]
    assert {len(raw) for raw in kept} == {HEAD_BYTES, len(LONG)}
    assert len(kept) + measures.values["deconflict_rejected_cut_total"]["nothing",] == 20_000


def test_the_hash_of_a_message_that_is_cut_is_recorded(tmp_path: Path) -> None:
    log, _ = recorder(tmp_path)
    for _ in range(20):
        log.received(LONG, NOW_S, LINE, "not-json")
    log.close()
    (file,) = tmp_path.glob("*")
    assert sha256(LONG).hexdigest().encode() in file.read_bytes().splitlines()[-1]
