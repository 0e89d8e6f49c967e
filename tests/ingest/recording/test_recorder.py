import json
import os
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.clock_notes import DAY_S, KnownTime
from ingest.recording.log_reader import Closed, EngineStarted, Event, Overtaken, Received, Tick
from ingest.recording.log_rotation import KEPT_BYTES
from ingest.recording.operator_events import Given
from ingest.recording.recorder import FLUSH_BYTES, Recorder, quantise
from ingest.settings import RecorderSettings
from tests.helpers.saying import status
from tests.ingest.recording.made_logs import LINE, NOW_S, Clock, read, recorder
from tests.ingest.recording.packed_logs import settle

RAW = status("A-1", NOW_S)
ODD_JSON = b"nan NaN -nan(ind) -inf Infinity 1.#IND +0.5 .5 1. 01 1, 'a' True".split()
"""Values that are no JSON. Some are read all the same."""


@pytest.mark.parametrize(
    ("raw", "rejected"),
    [
        (status("A-1", NOW_S), None),
        (b' {"a" :1,"a":2, "\xc3\xbc": "\\u00fc"}', None),
        (b'{\n "pretty": true\n}', None),
        (b' {"within": "white space"}\t', None),
        (b"\xef\xbb\xbf{}", None),
        (b'{"message":{"message":{}},"n":1.50e2}', None),
        (b"nonsense \xe2\x82\xac\x00", "not-json"),
        (b"\xff\xfe not utf-8", "not-utf8"),
        (b"", "message-too-large"),
        *((b'{"x":%b}' % odd, None) for odd in ODD_JSON),
        (b'{"x":nan,"y":"\xff"}', None),
        (b'{"x":1}\0', None),
    ],
)
def test_a_message_comes_back_to_the_byte(tmp_path: Path, raw: bytes, rejected: str | None) -> None:
    writer, _ = recorder(tmp_path)
    writer.received(raw, NOW_S, LINE, rejected)
    writer.close()
    (event,), unreadable = read(tmp_path)
    assert isinstance(event, Received)
    assert event.raw == raw
    assert (event.arrival_s, event.connection.id, event.connection.vendor) == (NOW_S, 7, "Alder")
    assert event.refused == rejected
    assert unreadable == 0


@pytest.mark.parametrize("rejected", [None, "not-json"])
def test_a_message_of_a_broker_comes_back_with_language_and_topic(tmp_path: Path, rejected: str | None) -> None:
    writer, _ = recorder(tmp_path)
    sender = Connection(9, "broker", vendor="KIT", language="vda5050", topic='uagv/v2/KIT/"1"/state')
    writer.received(b"{}", NOW_S, sender, rejected)
    writer.overtaken(b"{}", NOW_S, sender)
    writer.close()
    events, unreadable = read(tmp_path)
    assert [event.connection for event in events if isinstance(event, Received | Overtaken)] == [sender] * 2
    assert unreadable == 0


@pytest.mark.parametrize("rejected", [None, "not-json"])
@pytest.mark.parametrize(
    "sender",
    [
        Connection(9, "10.0.0.7", vendor="Alder", proven=True),
        Connection(9, "10.0.0.7", vendor="Alder"),
        Connection(9, "broker", vendor="KIT", language="vda5050", topic="uagv/v2/KIT/1/state", proven=True),
        Connection(9, "broker", vendor="KIT", language="vda5050", topic="uagv/v2/KIT/1/state"),
    ],
)
def test_the_source_of_a_message_comes_back(tmp_path: Path, sender: Connection, rejected: str | None) -> None:
    writer, _ = recorder(tmp_path)
    writer.received(b"{}", NOW_S, sender, rejected)
    writer.close()
    ((event,), _) = read(tmp_path)
    assert isinstance(event, Received)
    assert (event.connection.proven, event.connection.source) == (sender.proven, sender.source)


def test_times_come_back_to_the_bit(tmp_path: Path) -> None:
    random, writer = Random(1), recorder(tmp_path)[0]
    times = [quantise(random.uniform(0.0, 4e9)) for _ in range(2000)]
    for t_s in times:
        writer.tick(t_s)
    writer.close()
    assert [event.now_s for event in read(tmp_path)[0] if isinstance(event, Tick)] == times


def test_a_time_is_kept_to_the_microsecond_that_is_written() -> None:
    assert quantise(1_790_000_000.123456_7) == 1_790_000_000.123457
    assert quantise(0.000_000_4) == 0.0


def test_events_come_back_in_order(tmp_path: Path) -> None:
    writer, _ = recorder(tmp_path)
    writer.engine_started(NOW_S)
    writer.received(status("A-1", NOW_S), NOW_S, LINE, None)
    writer.tick(NOW_S)
    writer.closed(LINE, NOW_S)
    writer.given("a", "Alder", NOW_S)
    writer.tick(NOW_S, effort=2)
    writer.close()
    events = read(tmp_path)[0]
    assert [type(event) for event in events] == [EngineStarted, Received, Tick, Closed, Given, Tick]
    assert Given("a", "Alder") in events
    assert [event.effort for event in events if isinstance(event, Tick)] == [0, 2]


def test_every_line_is_json_that_others_can_read(tmp_path: Path) -> None:
    writer, _ = recorder(tmp_path)
    writer.received(status("A-1", NOW_S, 1.5), NOW_S, LINE, None)
    writer.received(b"\xff", NOW_S, LINE, "not-utf8")
    writer.received(b'{"x":-nan(ind)}', NOW_S, LINE, None)
    writer.tick(NOW_S)
    writer.close()
    (segment,) = tmp_path.iterdir()
    lines = [json.loads(line) for line in segment.read_text().splitlines()]
    assert lines[0]["message"]["location"]["x"] == 1.5


def test_a_torn_log_is_never_written_on(tmp_path: Path) -> None:
    first, _ = recorder(tmp_path)
    first.tick(NOW_S)
    first.close()
    (segment,) = tmp_path.iterdir()
    with segment.open("ab") as torn:
        torn.write(b'{"received":"2026')
    clock = Clock()
    clock.now_s += 10
    second = Recorder(RecorderSettings(), tmp_path, Measures(), clock)
    second.tick(NOW_S + 1)
    second.close()
    events, unreadable = read(tmp_path)
    assert [event.now_s for event in events if isinstance(event, Tick)] == [NOW_S, NOW_S + 1]
    assert unreadable == 1


def test_a_tick_passes_all_earlier_lines_to_the_system(tmp_path: Path) -> None:
    writer, _ = recorder(tmp_path)
    writer.received(status("A-1", NOW_S), NOW_S, LINE, None)
    assert read(tmp_path)[0] == []
    writer.tick(NOW_S)
    assert writer.sync()
    assert len(read(tmp_path)[0]) == 2
    writer.close()


def test_without_ticks_lines_are_written_all_the_same(tmp_path: Path) -> None:
    writer, _ = recorder(tmp_path)
    raw = status("A-1", NOW_S)
    for _ in range(FLUSH_BYTES // len(raw)):
        writer.received(raw, NOW_S, LINE, None)
    assert writer.sync()
    written = sum(segment.stat().st_size for segment in tmp_path.iterdir())
    writer.close()
    assert written >= FLUSH_BYTES


ROUNDS = 5
"""A busy system keeps pages that it uses just then; the next round lets go of them."""


def test_what_was_recorded_long_ago_is_not_kept_in_memory(tmp_path: Path) -> None:
    if _is_in_memory(_synced(tmp_path / "probe", b"anything")):
        pytest.skip("this file system keeps all it has in memory")
    writer, _ = recorder(tmp_path / "log")
    _record(writer, 2 * KEPT_BYTES)
    (log,) = (tmp_path / "log").iterdir()
    for _ in range(ROUNDS):
        _synced(log)
        _record(writer, KEPT_BYTES)
        if not (_is_in_memory(log) or _is_in_memory(log, KEPT_BYTES)):
            break
    else:
        pytest.fail("what was written long ago is still in memory")
    writer.close()


def _record(writer: Recorder, much: int) -> None:
    for _ in range(much // len(RAW) + 1):
        writer.received(RAW, NOW_S, LINE, None)
    writer.flush()
    assert writer.sync()


def _synced(path: Path, data: bytes = b"") -> Path:
    """The file, with `data` at its end, written out and as little kept as the file system can."""
    with path.open("ab", buffering=0) as file:
        file.write(data)
        os.fsync(file)
        if data:
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    return path


def _is_in_memory(path: Path, at: int = 0) -> bool:
    with path.open("rb", buffering=0) as file:
        try:
            return os.preadv(file.fileno(), [bytearray(1)], at, os.RWF_NOWAIT) > 0
        except BlockingIOError:
            return False
        except OSError:
            pytest.skip("this file system does not tell what it keeps in memory")


def test_segments_stay_in_order_though_the_clock_is_set_back(tmp_path: Path) -> None:
    for now_s in (NOW_S, NOW_S - 3600.0, NOW_S - 7200.0):
        clock = Clock()
        clock.now_s = now_s
        writer = Recorder(RecorderSettings(), tmp_path, Measures(), clock)
        writer.tick(now_s)
        writer.close()
    ticks = [event.now_s for event in read(tmp_path)[0] if isinstance(event, Tick)]
    assert ticks == [NOW_S, NOW_S - 3600.0, NOW_S - 7200.0]


def test_only_our_own_segments_are_ever_removed(tmp_path: Path) -> None:
    for name in ("notes.txt", "log-of-the-fair.jsonl"):
        (tmp_path / name).write_bytes(b"x" * 20_000)
    writer, _ = recorder(tmp_path, segment_bytes=100, total_bytes=200)
    for i in range(50):
        writer.tick(NOW_S + i)
    writer.close()
    kept = {path.name for path in tmp_path.iterdir()}
    assert {"notes.txt", "log-of-the-fair.jsonl"} <= kept
    assert len(kept) <= 4


def test_segments_rotate_and_the_oldest_go(tmp_path: Path) -> None:
    writer, _ = recorder(tmp_path, segment_bytes=2_000, total_bytes=10_000)
    for i in range(400):
        writer.tick(NOW_S + i)
    writer.close()
    sizes = [segment.stat().st_size for segment in tmp_path.iterdir()]
    assert len(sizes) > 2
    assert sum(sizes) <= 10_000
    ticks = [event.now_s for event in read(tmp_path)[0] if isinstance(event, Tick)]
    assert ticks == [NOW_S + i for i in range(400 - len(ticks), 400)]


def test_a_segment_is_begun_each_day_and_goes_when_it_is_too_old(tmp_path: Path) -> None:
    clock = Clock()
    writer = Recorder(RecorderSettings(keep_days=2.5), tmp_path, Measures(), clock, clock.known)
    for day in range(6):
        clock.now_s = NOW_S + day * 90_000.0
        for hour in (0, 1):
            writer.tick(clock.now_s + hour)
            assert writer.sync()
        settle(writer)  # a segment that is packed as it is removed is there for one rotation more
        newest = max(tmp_path.glob("*.jsonl"))
        os.utime(newest, (clock.now_s, clock.now_s))
    writer.close()
    ticks = [event.now_s for event in read(tmp_path)[0] if isinstance(event, Tick)]
    assert [round((tick_s - NOW_S) / 90_000.0, 2) for tick_s in ticks] == [3.0, 3.0, 4.0, 4.0, 5.0, 5.0]


@pytest.mark.parametrize(("modified_s", "total_bytes"), [(9.0, 1_000_000), (NOW_S, 10_000)], ids=["age", "size"])
def test_an_old_segment_that_cannot_be_removed_stops_no_recording_and_is_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, modified_s: float, total_bytes: int
) -> None:
    """A folder can't be removed as a file. A link to nothing looks like a segment that has just vanished."""
    folder, vanished, old = (tmp_path / f"log-{number:017d}.jsonl" for number in (1, 2, 3))
    folder.mkdir()
    vanished.symlink_to(tmp_path / "nothing")
    old.write_bytes(b" " * 20_000)
    for path in (folder, old):
        os.utime(path, (modified_s, modified_s))
    writer, _ = recorder(tmp_path, segment_bytes=100, total_bytes=total_bytes)
    ticks = [Tick(NOW_S + second) for second in range(12)]
    for tick in ticks:
        writer.tick(tick.now_s)
        assert writer.sync()
    assert writer.failing is None
    writer.close()
    vanished.unlink()
    assert read(tmp_path)[0] == ticks
    assert folder.exists()
    assert not old.exists()
    (message,) = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert f"{folder} can't be removed" in message


@pytest.mark.parametrize(
    ("known", "limits", "left"),
    [
        (KnownTime(0.0, NOW_S), {"keep_days": 2.0}, "12345"),
        (KnownTime(NOW_S, NOW_S), {"keep_days": 2.0}, "345"),
        (KnownTime(NOW_S, NOW_S), {"keep_days": 0.5}, ""),
        (KnownTime(NOW_S, NOW_S), {"keep_days": 2.0, "total_bytes": 45}, "5"),
    ],
    ids=["not known", "known", "all old", "size"],
)
def test_segments_are_old_in_the_order_of_writing_whatever_the_clock_said(
    tmp_path: Path, known: KnownTime, limits: dict[str, float], left: str
) -> None:
    """The third was written with a clock a month ahead, and the last with one a year behind."""
    for number, day in enumerate((-4.0, -3.0, 30.0, -1.0, -365.0), 1):
        path = tmp_path / f"log-{number:017d}.jsonl"
        path.write_bytes(b" " * 10)
        os.utime(path, (NOW_S + day * DAY_S, NOW_S + day * DAY_S))
    writer = Recorder(RecorderSettings(segment_bytes=30, **limits), tmp_path, Measures(), Clock(), lambda: known)
    writer.tick(NOW_S)
    writer.close()
    assert "".join(str(number) for number in range(1, 6) if any(tmp_path.glob(f"log-{number:017d}.jsonl*"))) == left


def test_a_log_of_the_first_release_is_read_to_the_last_line(tmp_path: Path) -> None:
    """As it was written then: no vendor, no engine's start, a rejected message quoted."""
    (tmp_path / "log-01790000000000000.jsonl").write_text(
        '{"received":"2026-09-21T14:13:20.000000Z","connection":1,"peer":"127.0.0.1:1","message":{"uuid":"a"}}\n'
        '{"received":"2026-09-21T14:13:20.500000Z","connection":1,"peer":"127.0.0.1:1","rejected":"not-json","raw":"{"}\n'
        '{"tick":"2026-09-21T14:13:21.000000Z"}\n'
        '{"closed":"2026-09-21T14:13:22.000000Z","connection":1}\n'
    )
    events, unreadable = read(tmp_path)
    assert [type(event) for event in events] == [Received, Received, Tick, Closed]
    assert unreadable == 0
    assert isinstance(events[0], Received)
    assert (events[0].raw, events[0].connection.vendor) == (b'{"uuid":"a"}', None)


FAILING = """
import logging, resource, signal, sys
from pathlib import Path
logging.basicConfig(format="%(levelname)s")
from ingest.measures.measures import Measures
from ingest.recording.recorder import Recorder
from ingest.settings import RecorderSettings
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
now = [1790000000.0]
def clock():
    now[0] += 0.001
    return now[0]
measures = Measures()
recorder = Recorder(RecorderSettings(), Path(sys.argv[1]), measures, clock)
def tick(t):
    recorder.tick(t)
    assert recorder.sync()
tick(1.0)
_, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), hard))
for t in (2.0, 3.0):
    recorder.engine_started(t)
    tick(t)
assert recorder.failing, "the failure is told"
resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
now[0] += float(sys.argv[3])
tick(4.0)
assert recorder.failing is None
recorder.close()
print(int(measures.values["deconflict_recorded_lines_dropped_total"][()]))
print(int(measures.values["deconflict_recorded_bytes_total"][()]))
"""
TICK_BYTES, START_BYTES = 38, 56
"""Lengths of the lines that the script above writes."""


@pytest.mark.parametrize("later_s", [6, -7200], ids=["in time", "clock set back"])
@pytest.mark.parametrize(
    ("room", "dropped", "kept"),
    [
        (0, 4, [Tick]),
        (TICK_BYTES + 20, 4, [Tick]),
        (TICK_BYTES + START_BYTES + 10, 3, [Tick, EngineStarted]),
    ],
    ids=["none", "half a line", "a line and a half"],
)
def test_what_cannot_be_recorded_is_counted_and_recording_resumes(
    tmp_path: Path, room: int, dropped: int, kept: list[type[Event]], later_s: int
) -> None:
    """A limit on file size stands in for a full disk: it lets part of a write through, as a full disk does."""
    script = [sys.executable, "-c", FAILING, str(tmp_path), str(room), str(later_s)]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr.split() == ["ERROR", "WARNING"], "the failure and its end are told once each"
    lines, written = map(int, done.stdout.split())
    events, unreadable = read(tmp_path)
    assert lines == dropped
    assert [type(event) for event in events] == [*kept, Tick]
    assert unreadable == (room > TICK_BYTES)
    assert written == sum(segment.stat().st_size for segment in tmp_path.iterdir())


def test_nothing_is_written_where_recording_is_off(tmp_path: Path) -> None:
    writer = Recorder(RecorderSettings(enabled=False), tmp_path, Measures(), Clock())
    writer.tick(NOW_S)
    writer.close()
    assert not list(tmp_path.iterdir())


def test_a_log_whose_newest_file_was_removed_begins_a_new_one(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    writer, _ = recorder(tmp_path)
    writer.tick(NOW_S)
    assert writer.sync()
    for file in tmp_path.iterdir():
        file.unlink()
    writer.tick(NOW_S + 1)
    writer.close()
    assert read(tmp_path)[0] == [Tick(NOW_S + 1)]
    assert "was removed" in caplog.text
