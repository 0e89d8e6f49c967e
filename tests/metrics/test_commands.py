"""What the commands on logs refuse before they read a log, and what they log about a log that they read."""

import gzip
import json
import logging
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from ingest.recording.log_packing import LogPacker
from ingest.recording.log_reader import by_time
from ingest.recording.log_segments import segments
from metrics.replay_files import LogError
from tests.helpers.commands import run
from tests.helpers.patience import PATIENCE_S
from tests.metrics.replay.made_replays import log_of_a_crossing


def scores(out: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(out.read_text())
    return {name: value for name, value in document.items() if name != "speed_x_real_time"}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return log_of_a_crossing(tmp_path / "log.jsonl")


@pytest.mark.parametrize("clearance", ["-1", "nan", "inf", "-0.1", "wide"])
def test_a_clearance_that_is_not_a_distance_is_refused(
    log: Path, clearance: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        run("replay", log, f"--clearance={clearance}")
    assert f"{clearance!r} is not in range: give a number from 0 to 100000" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("replay", "--json"),
        ("replay", "--html"),
        ("replay", "--advisories"),
        ("replay", "--situations"),
        ("replay", "--probabilities"),
        ("replay", "--mcap"),
        ("conform", "--json"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_before_anything_is_read(
    tmp_path: Path, log: Path, command: str, option: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("metrics.commands.LogReader.read", lambda *_: pytest.fail("it was read"))
    for out in (tmp_path / "none" / "out", tmp_path, log / "out"):
        with pytest.raises(LogError, match="can't be written: give a file in an existing directory"):
            run(command, log, option, out)
    kept = log.read_bytes()
    with pytest.raises(LogError, match="is a log to be read"):
        run(command, log.parent, option, log)
    assert log.read_bytes() == kept


@pytest.mark.parametrize("command", ["replay", "conform", "losses"])
def test_no_output_replaces_the_site_file_or_a_database(tmp_path: Path, log: Path, command: str) -> None:
    site, database = tmp_path / "site.toml", tmp_path / "losses.db"
    site.write_text("")
    with closing(sqlite3.connect(database)) as db:
        db.execute("PRAGMA user_version = 1")
    option, logs = ("--csv", ["--data", tmp_path]) if command == "losses" else ("--json", [log])
    for out, what in ((site, "the site file"), (database, "a database")):
        kept = out.read_bytes()
        with pytest.raises(LogError, match=f"is {what}: give the output another name"):
            run(command, *logs, "--site", site, option, out)
        assert out.read_bytes() == kept


@pytest.mark.parametrize(
    ("option", "other", "name"),
    [
        ("--json", "--html", "out"),
        ("--advisories", "--situations", "out"),
        ("--advisories", "--situations", "out-0.5"),
        ("--json", "--mcap", "link"),
    ],
)
def test_two_outputs_of_one_name_are_refused_before_anything_is_read(
    tmp_path: Path, log: Path, option: str, other: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("metrics.commands.LogReader.read", lambda *_: pytest.fail("it was read"))
    (tmp_path / "link").symlink_to("out")
    clearances = ("--clearance", "0.3", "0.5") if name == "out-0.5" else ()
    for other_out in (tmp_path / name, tmp_path / ".." / tmp_path.name / name):
        with pytest.raises(LogError, match=f"{name} is named for two outputs: give each a name of its own"):
            run("replay", log, *clearances, option, tmp_path / "out", other, other_out)


def test_two_outputs_may_go_to_a_device(log: Path) -> None:
    run("replay", log, "--jobs", "1", "--json", "/dev/null", "--advisories", "/dev/null")


def test_equal_clearances_count_once_and_near_ones_have_files_of_their_own(tmp_path: Path, log: Path) -> None:
    out, clearances = tmp_path / "scores.json", ("0.3", "0.3", "0.30000001", "1.0")
    run("replay", log, "--jobs", "1", "--clearance", *clearances, "--json", out, "--advisories", tmp_path / "out.jsonl")
    assert [score["clearance_m"] for score in scores(out)["scores"]] == [0.3, 0.30000001, 1.0]
    assert {path.name for path in tmp_path.glob("out*")} == {"out-0.3.jsonl", "out-0.30000001.jsonl", "out-1.jsonl"}
    for path in tmp_path.glob("out*"):
        revisions = [json.loads(line) for line in path.read_text().splitlines()]
        assert [revision["seq"] for revision in revisions] == list(range(1, len(revisions) + 1)) != []


@pytest.mark.parametrize("command", ["replay", "conform"])
def test_a_log_without_any_message_is_refused(tmp_path: Path, command: str) -> None:
    with pytest.raises(LogError, match=f"no log is in {tmp_path}"):
        run(command, tmp_path)
    log, out = tmp_path / "empty.jsonl", tmp_path / "out.json"
    for text, torn in (
        ("", ""),
        ("torn\n" * 3, ", only 3 lines that can't be read"),
        ('{"tick":"2009-11-17T10:00:21Z"}\n', ""),
    ):
        log.write_text(text)
        for given in (log, tmp_path):
            with pytest.raises(LogError, match=f"no message is in {given}{torn}: give lines"):
                run(command, given, "--json", out)
    assert not out.exists()


@pytest.mark.parametrize("command", ["replay", "conform", "site suggest"])
def test_a_missing_log_is_refused(tmp_path: Path, command: str) -> None:
    with pytest.raises(LogError, match=r"none.jsonl can't be read"):
        run(*command.split(), tmp_path / "none.jsonl")


@pytest.mark.parametrize("text", ['{"scores": 3}', '{"scores": [{"clearance_m": 0.3}]}', "[]", "{", "\xff", None])
def test_a_file_that_is_not_a_result_is_not_compared(tmp_path: Path, text: str | None) -> None:
    result = tmp_path / "one.json"
    if text is not None:
        result.write_bytes(text.encode("latin-1"))
    with pytest.raises(LogError, match=r"one.json (can't be read|is not the result|or .* lacks)"):
        run("replay", "--compare", result, result)


def in_two(log: Path) -> tuple[Path, Path]:
    """A log in two files. The first half is compressed and comes last by name."""
    lines = log.read_bytes().splitlines(keepends=True)
    first, second = log.with_name("b.jsonl"), log.with_name("a.jsonl")
    first.write_bytes(gzip.compress(b"".join(lines[: len(lines) // 2])))
    second.write_bytes(b"".join(lines[len(lines) // 2 :]))
    log.unlink()
    return first, second


def test_files_in_the_wrong_order_give_the_scores_of_the_whole(tmp_path: Path, log: Path) -> None:
    out = tmp_path / "out.json"
    run("replay", log, "--json", out)
    wanted = scores(out)
    first, second = in_two(log)
    for given in ([second, first], [first, second], [tmp_path]):
        run("replay", *given, "--json", out)
        assert scores(out) == wanted
    assert "late_messages" not in wanted


def test_a_recording_that_is_partly_packed_gives_the_scores_of_the_whole_also_if_more_is_packed_meanwhile(
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, recording = tmp_path / "out.json", tmp_path / "recording"
    run("replay", log, "--json", out)
    lines, wanted = log.read_bytes().splitlines(keepends=True), scores(out)
    recording.mkdir()
    for first in range(0, len(lines), 10):
        (recording / f"log-{first:017d}.jsonl").write_bytes(b"".join(lines[first : first + 10]))
    pack_oldest(recording)

    def packed_once_listed(logs: list[Path]) -> list[Path]:
        files = by_time(logs)
        pack_oldest(recording)
        return files

    monkeypatch.setattr("metrics.commands.by_time", packed_once_listed)
    run("replay", recording, "--json", out)
    assert len(list(recording.glob("*.zst"))) == 4
    assert scores(out) == wanted


def pack_oldest(recording: Path) -> None:
    """Two of the plain segments, as a service does that goes on recording."""
    packer = LogPacker()
    packer.pack(segments(recording))
    packer.close(PATIENCE_S)


def swap(lines: list[str]) -> list[str]:
    """The lines with each two neighbours swapped."""
    return [line for pair in zip(lines[1::2], lines[::2], strict=True) for line in pair]


def of_each_robot(lines: list[str]) -> list[str]:
    return sorted(lines, key=lambda line: json.loads(line)["message"]["uuid"])


@pytest.mark.parametrize(("disorder", "level"), [(swap, logging.INFO), (of_each_robot, logging.WARNING)])
@pytest.mark.parametrize("command", ["replay", "conform"])
def test_messages_out_of_order_are_counted_and_a_large_disorder_is_a_warning(
    tmp_path: Path,
    log: Path,
    command: str,
    disorder: Callable[[list[str]], list[str]],
    level: int,
    caplog: pytest.LogCaptureFixture,
) -> None:
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(disorder(spread_out(lines))))
    caplog.set_level(logging.INFO)
    run(command, log, "--json", tmp_path / "out.json")
    result = scores(tmp_path / "out.json")
    assert (result["messages"], result["late_messages"] > 10, result["late_by_s"] > 1) == (
        52,
        True,
        level == logging.WARNING,
    )
    (warning,) = (record for record in caplog.records if " messages " in record.message)
    assert (warning.levelno, "sort the lines" in warning.message) == (level, level == logging.WARNING)
    assert f"{result['late_messages']} messages come after messages" in warning.message


def spread_out(lines: list[str]) -> list[str]:
    """The lines with the second of each two a few milliseconds later."""
    return [line.replace(".05", ".056", 1) if n % 2 else line for n, line in enumerate(lines)]


def test_a_replay_ends_with_a_summary_for_people_and_says_what_it_wrote(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scores.json"
    run("replay", log, "--json", out)
    written = capsys.readouterr()
    assert not written.out
    assert "2 robots of 1 vendor got in each other's way" in written.err
    assert "came true" in written.err
    assert written.err.endswith(f"Wrote {out}\n")


@pytest.mark.parametrize("command", ["replay", "conform"])
def test_what_a_command_prints_of_hostile_names_is_visible_text(
    log: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    log.write_text(log.read_text().replace("Alder", "Al\\u001b[2J\\n\\u009b\\u202eder"))
    run(command, log)
    written = capsys.readouterr()
    assert "Al\\x1b[2J" in written.out + written.err
    assert all(line.isprintable() for line in (written.out + written.err).split("\n"))


def test_conform_makes_the_directory_for_its_pages(log: Path, tmp_path: Path) -> None:
    run("conform", log, "--html", tmp_path / "new" / "pages")
    assert list((tmp_path / "new" / "pages").glob("*.html"))
