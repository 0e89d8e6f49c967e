"""Work that waits for the disk."""

import threading

import pytest

from deconflict.operator.store import pending_writes
from deconflict.operator.store.pending_writes import DiskWork
from tests.helpers.patience import PATIENCE_S


async def test_a_fault_of_the_program_is_logged_at_once_and_stops_no_later_write(
    caplog: pytest.LogCaptureFixture,
) -> None:
    faults, written = [ValueError("made")], list[str]()

    def work() -> None:
        if faults:
            raise faults.pop()
        written.append("all")

    writing = DiskWork(work)
    await writing.do()
    assert "ValueError: made" in caplog.text
    await writing.do()
    assert written == ["all"]


async def test_the_end_waits_no_longer_than_it_says_and_logs_what_may_be_lost(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pending_writes, "WAIT_S", 0.0)
    goes_on = threading.Event()
    writing = DiskWork(lambda: assert_set(goes_on))
    await writing.settled(0.0)
    assert not caplog.records, "nothing is due"
    await writing.do()
    await writing.settled(0.0)
    assert "may be lost" in caplog.text
    goes_on.set()
    await writing.settled(PATIENCE_S)
    assert len(caplog.records) == 1


def assert_set(event: threading.Event) -> None:
    assert event.wait(PATIENCE_S)
