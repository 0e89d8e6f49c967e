import resource
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from ingest.recording.clock_notes import KnownTime
from ingest.recording.log_rotation import RETRY_S, RotatingLog
from ingest.settings import RecorderSettings

LINES = b"{}\n" * 100


@pytest.fixture
def now_s() -> list[float]:
    return [1_790_000_000.0]


@pytest.fixture
def segments(tmp_path: Path, now_s: list[float]) -> RotatingLog:
    return RotatingLog(RecorderSettings(), tmp_path / "log", lambda: now_s[0], lambda: KnownTime(0.0, 0.0))


@contextmanager
def full_disk() -> Iterator[None]:
    """A limit on file size stands in for it: files can be made, and nothing can be written."""
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)


def test_a_disk_that_stays_full_does_not_fill_with_empty_segments(
    tmp_path: Path, segments: RotatingLog, now_s: list[float]
) -> None:
    for _ in range(20):
        with full_disk():
            assert segments.write(LINES) == 0
        now_s[0] += 2 * RETRY_S
    assert segments.failing
    assert not list((tmp_path / "log").iterdir())


def test_what_is_recorded_is_in_the_directory_also_after_it_was_moved_away_and_a_copy_put_in_its_place(
    tmp_path: Path, segments: RotatingLog, now_s: list[float]
) -> None:
    segments.write(LINES)
    (tmp_path / "log").rename(tmp_path / "moved")
    shutil.copytree(tmp_path / "moved", tmp_path / "log")
    now_s[0] += 1.0
    segments.write(LINES)
    segments.write(LINES)
    segments.close()
    assert [file.stat().st_size for file in (tmp_path / "moved").iterdir()] == [len(LINES)]
    sizes = [file.stat().st_size for file in sorted((tmp_path / "log").iterdir())]
    assert sizes == [len(LINES), 2 * len(LINES)]
