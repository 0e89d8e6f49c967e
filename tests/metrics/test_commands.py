"""What the commands on logs refuse, before they read any, and what they say of what they have read."""

import gzip
import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deconflict.__main__ import parser
from metrics.commands import LogError
from tests.metrics.replay.made_replays import log_of_a_crossing


def run(*words: str | Path) -> None:
    args = parser().parse_args([str(word) for word in words])
    assert args.run(args) == 0


def scores(out: Path) -> dict[str, Any]:
    told: dict[str, Any] = json.loads(out.read_text())
    return {name: value for name, value in told.items() if name != "speed_x_real_time"}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return log_of_a_crossing(tmp_path / "log.jsonl")


@pytest.mark.parametrize("clearance", ["-1", "nan", "inf", "-0.1", "wide"])
def test_a_clearance_that_is_no_distance_is_refused(
    log: Path, clearance: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        run("replay", log, f"--clearance={clearance}")
    assert f"{clearance!r} is no distance: give metres, 0 or more" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("replay", "--json"),
        ("replay", "--html"),
        ("replay", "--advisories"),
        ("replay", "--mcap"),
        ("conform", "--json"),
    ],
)
def test_what_has_no_place_to_be_written_to_is_refused_before_anything_is_read(
    tmp_path: Path, log: Path, command: str, option: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("metrics.commands.Reader.read", lambda *_: pytest.fail("it was read"))
    for out in (tmp_path / "none" / "out", tmp_path, log / "out"):
        with pytest.raises(LogError, match="can't be written: give a file in a directory that is there"):
            run(command, log, option, out)
    kept = log.read_bytes()
    with pytest.raises(LogError, match="is the log that is to be read"):
        run(command, log.parent, option, log)
    assert log.read_bytes() == kept


@pytest.mark.parametrize("command", ["replay", "conform"])
def test_a_log_without_any_message_is_told(tmp_path: Path, command: str) -> None:
    with pytest.raises(LogError, match=f"no log is in {tmp_path}"):
        run(command, tmp_path)
    log, out = tmp_path / "empty.jsonl", tmp_path / "out.json"
    for text, torn in (
        ("", ""),
        ("torn\n" * 3, " and 3 lines that are none"),
        ('{"tick":"2009-11-17T10:00:21Z"}\n', ""),
    ):
        log.write_text(text)
        for given in (log, tmp_path):
            with pytest.raises(LogError, match=f"no message is in {given}{torn}: give lines"):
                run(command, given, "--json", out)
    assert not out.exists()


@pytest.mark.parametrize("command", ["replay", "conform", "site suggest"])
def test_a_log_that_is_not_there_is_refused(tmp_path: Path, command: str) -> None:
    with pytest.raises(LogError, match=r"none.jsonl can't be read"):
        run(*command.split(), tmp_path / "none.jsonl")


@pytest.mark.parametrize("told", ['{"scores": 3}', '{"scores": [{"clearance_m": 0.3}]}', "[]", "{", "\xff", None])
def test_what_is_no_result_is_not_compared(tmp_path: Path, told: str | None) -> None:
    one = tmp_path / "one.json"
    if told is not None:
        one.write_bytes(told.encode("latin-1"))
    with pytest.raises(LogError, match=r"one.json (can't be read|is no result|or .* lacks)"):
        run("replay", "--compare", one, one)


def in_two(log: Path) -> tuple[Path, Path]:
    """The first half of a log in the file that comes last by name, and packed."""
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


def swap(lines: list[str]) -> list[str]:
    """Each two neighbours, which stand 50 ms apart at most or a second, the other way round."""
    return [one for pair in zip(lines[1::2], lines[::2], strict=True) for one in pair]


def of_each_robot(lines: list[str]) -> list[str]:
    return sorted(lines, key=lambda line: json.loads(line)["message"]["uuid"])


@pytest.mark.parametrize(("disorder", "level"), [(swap, logging.INFO), (of_each_robot, logging.WARNING)])
@pytest.mark.parametrize("command", ["replay", "conform"])
def test_messages_out_of_order_are_counted_and_told_as_loudly_as_they_deserve(
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
    told = scores(tmp_path / "out.json")
    assert (told["messages"], told["late_messages"] > 10, told["late_by_s"] > 1) == (52, True, level == logging.WARNING)
    (said,) = (one for one in caplog.records if one.name == "metrics.commands")
    assert (said.levelno, "sort the lines" in said.message) == (level, level == logging.WARNING)
    assert f"{told['late_messages']} messages stand behind others" in said.message


def spread_out(lines: list[str]) -> list[str]:
    """The second of each two a few milliseconds later."""
    return [line.replace(".05", ".056", 1) if n % 2 else line for n, line in enumerate(lines)]
