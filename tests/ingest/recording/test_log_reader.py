import gzip
import json
import os
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest
import zstandard

from ingest.languages import timestamps
from ingest.recording.log_reader import LOGGED_LINES, LogReader, Received, Tick, by_time, segments_until
from ingest.recording.log_segments import segments
from tests.helpers.saying import status
from tests.ingest.recording.made_logs import LINE, NOW_S, read, recorder


def test_a_log_cut_at_any_byte_loses_only_the_line_that_is_cut(tmp_path: Path) -> None:
    writer, _ = recorder(tmp_path / "whole")
    for i in range(3):
        writer.received(status("A-1", NOW_S + i), NOW_S + i, LINE, None)
    writer.close()
    (segment,) = (tmp_path / "whole").iterdir()
    data = segment.read_bytes()
    last = data.rindex(b"\n", 0, len(data) - 1) + 1
    cut = tmp_path / "cut.jsonl"
    for length in range(last, len(data)):
        cut.write_bytes(data[:length])
        events, unreadable = read(cut)
        whole = length == len(data) - 1  # only the line's end is missing
        assert len(events) == 2 + whole
        assert unreadable == (length > last and not whole)


@pytest.mark.parametrize("suffix", ["", ".gz", ".zst"])
def test_foreign_logs_are_read_plain_and_compressed(tmp_path: Path, suffix: str) -> None:
    line = b'{"received": "2009-11-17T10:00:21.586Z", "message": {"uuid": "x", "n": 1.0}}\n'
    data = line + b"not a line\n" + line.replace(b'{"received"', b'{"other": 1, "received"')
    packed = {"": data, ".gz": gzip.compress(data), ".zst": zstandard.compress(data)}[suffix]
    log = tmp_path / f"log.jsonl{suffix}"
    log.write_bytes(packed)
    for where in (log, tmp_path):
        events, unreadable = read(where)
        assert unreadable == 1
        assert [json.loads(event.raw) for event in events if isinstance(event, Received)] == [
            {"uuid": "x", "n": 1.0}
        ] * 2


@pytest.mark.parametrize(
    "message",
    ['{"n": 1.50, "n": 1e2}', '{"message": {"message": [{}]}}', '{"n": NaN}', "[1, 2]", '"\\u00fc"'],
)
@pytest.mark.parametrize(
    "line",
    [
        '{{"received": "2009-11-17T10:00:21Z", "message": {}}}',
        '{{"message" :{}, "peer": {{"message": {{}}}}, "received": "2009-11-17T10:00:21Z"}}',
        '{{"received": "2009-11-17T10:00:21Z", "message":{}, "x": {{"message": 1}}}}',
        '{{"x": {{"message": 1}}, "received": "2009-11-17T10:00:21Z", "message":{}}}',
    ],
    ids=["last", "first", "in the middle", "after another"],
)
def test_a_foreign_message_is_taken_as_it_stands(tmp_path: Path, line: str, message: str) -> None:
    log = tmp_path / "one.jsonl"
    log.write_text(line.format(message) + "\n")
    (event,), unreadable = read(log)
    assert isinstance(event, Received)
    assert (event.raw.decode(), event.arrival_s, unreadable) == (message, 1258452021.0, 0)


@pytest.mark.parametrize(
    "line",
    [
        b"[" * 100_000,
        b"[]",
        b"7",
        b'"tick"',
        b'{"tick": 7}',
        b'{"tick": "now"}',
        b'{"tick": "2009-11-17T10:00:21Z", "followed": 7}',
        b'{"tick": "2009-11-17T10:00:21Z", "followed": ["a"]}',
        b'{"received": "2009-11-17T10:00:21Z"}',
        b'{"received": null, "message": {}}',
        b'{"received": "2009-11-17T10:00:21Z", "base64": "?"}',
        b'{"received": "2009-11-17T10:00:21Z", "message": {}',
        b'{"given": "2009-11-17T10:00:21Z", "uuid": 5, "vendor": ["x"]}',
        b'{"topic": 5, "payload": {}, "time": 1}',
        b'{"topic": null, "payload": {}, "time": 1}',
        b'{"topic": "uagv/v2/KIT/0001/state", "payload": {}, "time": NaN}',
        b'{"topic": "uagv/v2/KIT/0001/state", "payload": {}, "time": 1e999}',
        b'{"topic": "uagv/v2/KIT/0001/state", "payload": {}, "time": 1' + 400 * b"0" + b"}",
        b"\xff",
    ],
)
def test_an_unreadable_line_is_counted_and_logged(
    tmp_path: Path, line: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    log = tmp_path / "one.jsonl"
    log.write_bytes(b'{"tick":"2009-11-17T10:00:21Z"}\n' + line + b'\n{"tick":"2009-11-17T10:00:22Z"}\n')
    events, unreadable = read(log)
    assert (len(events), unreadable) == (2, 1)
    assert f"{log}, line 2 is left out" in caplog.text


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b""])
def test_a_broken_line_is_answered_with_the_column_at_which_it_breaks(
    tmp_path: Path, end: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    log = tmp_path / "one.jsonl"
    log.write_bytes(b'{"tick":"2009-11-17T10:00:21Z"}\n{"tick":"2009-11-17T10' + end)
    assert read(log)[1] == 1
    (message,) = caplog.messages
    assert message == f"{log}, line 2 is left out: JSONDecodeError: Unterminated string starting at: column 9"


def test_a_time_as_a_number_is_answered_with_how_times_are_written(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = tmp_path / "one.jsonl"
    log.write_text('{"received": 1258452021.0, "message": {}}')
    assert read(log) == ([], 1)
    assert '1258452021.0 is no time, as "2026-11-22T10:00:00Z" is' in caplog.text


@pytest.mark.parametrize("pack", [bytes, gzip.compress, zstandard.compress])
@pytest.mark.parametrize("name", ["a.jsonl", "a.jsonl.gz", "a.jsonl.zst"])
def test_a_log_is_read_by_how_it_begins_whatever_it_is_called(
    tmp_path: Path, name: str, pack: Callable[[bytes], bytes]
) -> None:
    log = tmp_path / name
    log.write_bytes(pack(b'{"tick":"2009-11-17T10:00:21Z"}\n' * 3))
    events, unreadable = read(log)
    assert (len(events), unreadable) == (3, 0)


def test_a_log_that_pzstd_packed_begins_with_a_frame_to_skip(tmp_path: Path) -> None:
    log = tmp_path / "a.jsonl"
    log.write_bytes(b"\x50\x2a\x4d\x18\x04\0\0\0size" + zstandard.compress(b'{"tick":"2009-11-17T10:00:21Z"}\n'))
    assert [len(read(log)[0]), read(log)[1]] == [1, 0]


def heard(log: Path, *times_s: float) -> Path:
    log.write_text("".join(f'{{"received":"{timestamps.write(t_s)}","message":{{}}}}\n' for t_s in times_s))
    return log


def test_files_are_put_in_the_order_of_their_first_times(tmp_path: Path) -> None:
    (tmp_path / "many").mkdir()
    late, early = heard(tmp_path / "many" / "1.jsonl", NOW_S + 9), heard(tmp_path / "many" / "2.jsonl", NOW_S)
    between = tmp_path / "between.jsonl.gz"
    between.write_bytes(gzip.compress(heard(tmp_path / "plain", NOW_S + 5).read_bytes()))
    assert by_time([late, early]) == by_time([tmp_path / "many"]) == [early, late]
    assert by_time([tmp_path / "many", between]) == [early, between, late]


def test_a_file_without_a_time_stays_behind_the_one_before(tmp_path: Path) -> None:
    late, early = heard(tmp_path / "late", NOW_S + 9), heard(tmp_path / "early", NOW_S)
    empty, torn = heard(tmp_path / "empty"), tmp_path / "torn"
    torn.write_text("{")
    assert by_time([empty, late, torn, early]) == [empty, early, late, torn]


def test_logs_until_a_time_are_those_whose_first_time_is_earlier_whatever_their_names_say(tmp_path: Path) -> None:
    times_s = (NOW_S, NOW_S + 9e7, NOW_S + 5, NOW_S + 9)
    first, ahead, second, third = (
        heard(tmp_path / f"log-{number}.jsonl", t_s) for number, t_s in enumerate(times_s, 1)
    )
    heard(tmp_path / "log-5.jsonl")
    assert segments_until(tmp_path, NOW_S + 6) == [first, second]
    assert segments_until(tmp_path, NOW_S + 1e8) == [first, second, third, ahead]
    assert segments_until(tmp_path, NOW_S - 1) == segments_until(tmp_path / "none", NOW_S) == []


def test_a_pipe_is_not_read_to_find_its_order(tmp_path: Path) -> None:
    pipe, log = tmp_path / "pipe", heard(tmp_path / "log", NOW_S)
    os.mkfifo(pipe)
    assert by_time([pipe, log]) == [pipe, log]


def test_what_is_no_file_in_a_folder_of_logs_is_left_out(tmp_path: Path) -> None:
    log = heard(tmp_path / "log-2.jsonl", NOW_S)
    os.mkfifo(tmp_path / "log-1.jsonl")
    (tmp_path / "log-3.jsonl").symlink_to("/dev/zero")
    (tmp_path / "log-4.jsonl").mkdir()
    assert segments(tmp_path) == [log]
    assert len(list(LogReader().read([tmp_path]))) == 1


def test_messages_that_stand_behind_later_ones_are_counted(tmp_path: Path) -> None:
    reader = LogReader()
    log = heard(tmp_path / "log", NOW_S, NOW_S + 2, NOW_S + 1.5, NOW_S + 1, NOW_S + 2, NOW_S + 3)
    assert len(list(reader.read([log]))) == 6
    assert (reader.late, reader.own) == (2, False)
    assert reader.late_by_s == pytest.approx(1.0)


def test_of_many_unreadable_lines_only_the_first_are_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    log = tmp_path / "one.jsonl"
    log.write_text("nonsense\n" * 50)
    assert read(log) == ([], 50)
    assert len(caplog.records) == LOGGED_LINES


def test_a_foreign_connection_is_no_reason_to_stop(tmp_path: Path) -> None:
    log = tmp_path / "one.jsonl"
    log.write_text('{"received": "2009-11-17T10:00:21Z", "connection": "c1", "vendor": 3, "message": {}}\n')
    (event,), _ = read(log)
    assert isinstance(event, Received)
    assert (event.connection.id, event.connection.vendor) == (0, None)


@pytest.mark.parametrize("suffix", [".gz", ".zst"])
def test_a_compressed_log_that_breaks_off_gives_what_there_is(
    tmp_path: Path, suffix: str, caplog: pytest.LogCaptureFixture
) -> None:
    random = Random(1)
    data = b"".join(b'{"tick":"2009-11-17T10:00:21.%06dZ"}\n' % random.randrange(10**6) for _ in range(10_000))
    packed = {".gz": gzip.compress(data), ".zst": zstandard.compress(data)}[suffix]
    whole, broken = tmp_path / f"a.jsonl{suffix}", tmp_path / f"b.jsonl{suffix}"
    whole.write_bytes(packed + packed)
    broken.write_bytes(packed[: len(packed) // 2])
    assert len(read(whole)[0]) == 20_000
    events, unreadable = read(broken)
    assert 0 < len(events) < 10_000
    assert unreadable == 1
    assert f"{broken}, line {len(events) + 1} is left out" in caplog.text


def test_a_file_without_lines_is_not_read_into_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.recording.log_reader.LONGEST_LINE", 1000)
    log = tmp_path / "one.jsonl"
    log.write_bytes(b"x" * 5500)
    assert read(log) == ([], 6)


def test_a_directory_is_read_whole_where_somebody_packed_the_older_segments(tmp_path: Path) -> None:
    writer, _ = recorder(tmp_path, segment_bytes=1)
    for i in range(2):
        writer.tick(NOW_S + i)
    writer.close()
    oldest = min(tmp_path.iterdir())
    oldest.with_name(oldest.name + ".gz").write_bytes(gzip.compress(oldest.read_bytes()))
    oldest.unlink()
    assert [event.now_s for event in read(tmp_path)[0] if isinstance(event, Tick)] == [NOW_S + i for i in range(2)]


def test_a_file_that_the_disk_does_not_give_is_left_out() -> None:
    assert read(Path("/proc/self/mem")) == ([], 1)  # its first byte is an error of input
