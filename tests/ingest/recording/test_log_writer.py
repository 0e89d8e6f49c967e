import threading
from collections.abc import Callable, Iterator

import pytest

from ingest.recording.log_writer import LogWriter

TIMEOUT_S = 20.0


class Disk:
    """A disk that stalls until it is told to go on."""

    def __init__(self) -> None:
        self.go_on = threading.Event()
        self.blocks: list[bytes] = []

    def write(self, block: bytes) -> int:
        assert self.go_on.wait(TIMEOUT_S)
        self.blocks.append(block)
        return len(block)


@pytest.fixture
def disk() -> Iterator[Disk]:
    made_disk = Disk()
    yield made_disk
    made_disk.go_on.set()


def test_a_stalled_disk_blocks_nothing_and_loses_nothing_that_fits_in_memory(disk: Disk) -> None:
    writer = LogWriter(disk.write, 1000)
    blocks = [b"%d\n" % i for i in range(100)]
    for block in blocks:
        writer.add(block)
    assert writer.waiting
    assert not writer.sync(0.0)
    disk.go_on.set()
    assert writer.sync(TIMEOUT_S)
    assert disk.blocks == blocks
    assert writer.take_counts() == (sum(map(len, blocks)), 0)
    assert writer.take_counts() == (0, 0)


def test_lines_without_room_are_counted_and_logged_once(disk: Disk, caplog: pytest.LogCaptureFixture) -> None:
    writer = LogWriter(disk.write, 10)
    for block in (b"one\n", b"two\n", b"a\nb\nc\n", b"d\n", b"e\n"):
        writer.add(block)
    assert writer.failing
    disk.go_on.set()
    assert writer.sync(TIMEOUT_S)
    assert disk.blocks == [b"one\n", b"two\n", b"d\n"]
    assert writer.take_counts() == (10, 4)
    assert writer.failing is None
    assert [record.levelname for record in caplog.records] == ["ERROR", "WARNING"]


def test_a_close_waits_no_longer_than_it_is_told(disk: Disk) -> None:
    writer = LogWriter(disk.write, 1000)
    for block in (b"one\n", b"two\nthree\n"):
        writer.add(block)
    assert writer.close(0.0) is False
    assert writer.take_counts() == (0, 3)


def half(block: bytes) -> int:
    return len(block) // 2


def broken(block: bytes) -> int:
    raise RuntimeError


@pytest.mark.parametrize(("write", "written", "dropped"), [(half, 4, 1), (broken, 0, 2)])
def test_lines_that_are_not_wholly_written_are_counted(
    write: Callable[[bytes], int], written: int, dropped: int
) -> None:
    writer = LogWriter(write, 1000)
    writer.add(b"one\ntwo\n")
    assert writer.close(TIMEOUT_S)
    assert writer.take_counts() == (written, dropped)
