"""Older segments are packed, and each line is read exactly once whatever happens meanwhile."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

from ingest.measures.measures import Measures
from ingest.recording import log_packing
from ingest.recording.log_packing import PLAIN_SEGMENTS
from ingest.recording.log_reader import LogReader, Received, begun_s, by_time, ends_s, lines_of, segments_until
from ingest.recording.log_segments import packed_name, segments, text_bytes
from ingest.recording.recorder import Recorder
from ingest.settings import RecorderSettings
from tests.ingest.recording.made_logs import NOW_S, Clock, read
from tests.ingest.recording.packed_logs import drives, names, seconds, ticks

TICKS_A_SEGMENT = 3
STEPS = 7
"""Of packing one segment, at which the script below may die."""


def test_the_newest_segments_stay_plain_and_older_ones_are_packed_to_the_byte(tmp_path: Path) -> None:
    sent = drives(tmp_path, robots=20, segments=5)
    assert names(tmp_path) == ["packed"] * (5 - PLAIN_SEGMENTS) + ["plain"] * PLAIN_SEGMENTS
    events, unreadable = read(tmp_path)
    assert [event.raw for event in events if isinstance(event, Received)] == sent
    assert unreadable == 0


def test_packed_segments_take_less_than_a_fifth_of_the_room(tmp_path: Path) -> None:
    drives(tmp_path, robots=20, segments=5)
    for segment in tmp_path.glob("*.zst"):
        assert segment.stat().st_size < text_bytes(segment) / 5


def test_a_packed_segment_is_as_old_as_its_last_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_packing, "PLAIN_SEGMENTS", 3)
    ticks(tmp_path, range(9))
    written = {packed_name(segment): segment.stat().st_mtime_ns for segment in tmp_path.iterdir()}
    monkeypatch.undo()
    ticks(tmp_path, [9])
    packed = list(tmp_path.glob("*.zst"))
    assert [segment.stat().st_mtime_ns for segment in packed] == [written[segment] for segment in packed]
    assert packed


def test_the_limit_of_the_log_counts_what_is_stored(tmp_path: Path) -> None:
    sent = drives(tmp_path, robots=20, segments=9)
    lines = sum(text_bytes(segment) for segment in segments(tmp_path))
    stored = sum(segment.stat().st_size for segment in tmp_path.iterdir())
    settings = RecorderSettings(segment_bytes=200_000, total_bytes=stored + 300_000)
    assert settings.total_bytes < lines / 2
    writer = Recorder(settings, tmp_path, Measures(), Clock())
    writer.tick(NOW_S)
    writer.close()
    assert sum(isinstance(event, Received) for event in read(tmp_path)[0]) == len(sent)


KILLED = """
import os, signal, sys
from pathlib import Path
from ingest.recording import log_packing, replaced_file
from tests.ingest.recording.packed_logs import ticks
steps = [int(sys.argv[2])]
def counted(owner, name, before):
    call = getattr(owner, name)
    def step(*args, **named):
        if before:
            die()
        done = call(*args, **named)
        if not before:
            die()
        return done
    setattr(owner, name, step)
def die():
    steps[0] -= 1
    if steps[0] < 0:
        os.kill(os.getpid(), signal.SIGKILL)
counted(log_packing, "opened", before=False)
for name in ("utime", "fsync"):
    counted(os, name, before=True)
for name in ("replace", "unlink"):
    counted(Path, name, before=False)
ticks(Path(sys.argv[1]), range(int(sys.argv[3]), 1000))
"""


@pytest.mark.parametrize("step", range(STEPS))
def test_a_kill_at_any_step_of_packing_leaves_each_line_exactly_once(tmp_path: Path, step: int) -> None:
    for _ in range(2):
        begin = len(seconds(tmp_path))
        script = [sys.executable, "-c", KILLED, str(tmp_path), str(step), str(begin)]
        assert subprocess.run(script, check=False).returncode == -signal.SIGKILL
        assert seconds(tmp_path) == list(range(len(seconds(tmp_path))))
    begin = len(seconds(tmp_path))
    ticks(tmp_path, range(begin, begin + 30))
    assert seconds(tmp_path) == list(range(begin + 30))
    packed = len(list(tmp_path.iterdir())) - PLAIN_SEGMENTS
    assert names(tmp_path) == ["packed"] * packed + ["plain"] * PLAIN_SEGMENTS, "what a kill left is packed in time"


RECORDING = """
import sys
from pathlib import Path
from tests.ingest.recording.made_logs import NOW_S, recorder
writer, _ = recorder(Path(sys.argv[1]), segment_bytes=4_000)
second = int(sys.argv[2])
while True:
    writer.tick(NOW_S + second)
    assert writer.sync()
    print(second, flush=True)
    second += 1
"""


def test_a_recorder_that_is_killed_again_and_again_loses_and_repeats_nothing(tmp_path: Path) -> None:
    random, begin = Random(1), 0
    for _ in range(5):
        script = [sys.executable, "-c", RECORDING, str(tmp_path), str(begin)]
        with subprocess.Popen(script, stdout=subprocess.PIPE) as process:
            assert process.stdout
            for _ in range(random.randrange(500, 1500)):
                printed = int(process.stdout.readline())
            process.kill()
            rest = process.stdout.read().splitlines()
        printed = int(rest[-1]) if rest else printed
        recorded = seconds(tmp_path)
        assert recorded == list(range(len(recorded)))
        assert len(recorded) > printed
        begin = len(recorded)
    assert "packed" in names(tmp_path)


def test_of_a_plain_and_a_packed_file_of_one_segment_one_counts(tmp_path: Path) -> None:
    ticks(tmp_path, range(3 * TICKS_A_SEGMENT))
    oldest = min(tmp_path.iterdir())
    shutil.copyfile(oldest, tmp_path / "copy")
    oldest.with_suffix("").write_bytes(b"".join(lines_of(oldest)))
    assert seconds(tmp_path) == list(range(3 * TICKS_A_SEGMENT))
    oldest.write_bytes(b"this was not written to its end")
    assert seconds(tmp_path) == list(range(3 * TICKS_A_SEGMENT))
    ticks(tmp_path, [3 * TICKS_A_SEGMENT])
    assert oldest.read_bytes() == (tmp_path / "copy").read_bytes()
    assert not oldest.with_suffix("").exists()


@pytest.fixture
def listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Plain segments, of which the oldest were packed after they were listed."""
    monkeypatch.setattr(log_packing, "PLAIN_SEGMENTS", 100)
    ticks(tmp_path, range(5 * TICKS_A_SEGMENT))
    found = segments(tmp_path)
    monkeypatch.undo()
    for segment in found[:3]:
        assert log_packing._pack(segment)
    return found


def test_a_segment_that_is_packed_between_listing_and_opening_is_read(listed: list[Path]) -> None:
    assert not listed[0].exists()
    assert seconds(*listed) == list(range(5 * TICKS_A_SEGMENT))
    assert len([line for segment in listed for line in lines_of(segment)]) == 5 * TICKS_A_SEGMENT
    assert round(begun_s(listed[1]) - NOW_S) == TICKS_A_SEGMENT
    assert text_bytes(listed[0]) == text_bytes(listed[-1])


def test_a_segment_that_was_removed_after_it_was_listed_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"log-1\.jsonl'"):
        list(LogReader().read([tmp_path / "log-1.jsonl"]))


def test_a_segment_that_is_packed_while_the_directory_is_read_is_not_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_packing, "PLAIN_SEGMENTS", 100)
    ticks(tmp_path, range(3 * TICKS_A_SEGMENT))
    list_folder = Path.iterdir

    def packing(folder: Path) -> Iterator[Path]:
        for file in list(list_folder(folder)):
            if file.suffix == ".jsonl":
                log_packing._pack(file)
            yield file

    monkeypatch.setattr(Path, "iterdir", packing)
    found = segments(tmp_path)
    monkeypatch.undo()
    assert seconds(*found) == list(range(3 * TICKS_A_SEGMENT))


def test_the_newest_time_is_found_though_only_packed_segments_have_one(tmp_path: Path) -> None:
    ticks(tmp_path, range(5 * TICKS_A_SEGMENT))
    for segment in tmp_path.glob("*.jsonl"):
        segment.write_bytes(b"")
    assert round(ends_s(tmp_path) - NOW_S) == 3 * TICKS_A_SEGMENT - 1
    newest = max(tmp_path.glob("*.zst"))
    newest.write_bytes(newest.read_bytes()[:10])
    assert round(ends_s(tmp_path) - NOW_S) == 2 * TICKS_A_SEGMENT - 1


def test_packed_and_plain_segments_are_in_order_of_time(tmp_path: Path) -> None:
    ticks(tmp_path, range(5 * TICKS_A_SEGMENT))
    assert by_time([tmp_path]) == segments(tmp_path) == segments_until(tmp_path, NOW_S + 100)
    assert len(segments_until(tmp_path, NOW_S + TICKS_A_SEGMENT)) == 2


def test_a_damaged_packed_segment_is_reported_and_the_others_are_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    sent = drives(tmp_path, robots=20, segments=5)
    damaged = sorted(tmp_path.glob("*.zst"))[1]
    content = bytearray(damaged.read_bytes())
    content[len(content) // 2] ^= 1
    damaged.write_bytes(content)
    events, unreadable = read(tmp_path)
    assert unreadable == 1
    assert f"{damaged}, line" in caplog.text
    raws = [event.raw for event in events if isinstance(event, Received)]
    whole = sum(isinstance(event, Received) for event in read(min(tmp_path.iterdir()))[0])
    assert raws[:whole] == sent[:whole] != []
    assert raws[-1] == sent[-1]
