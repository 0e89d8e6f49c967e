"""Replays side by side write the files of one process, and end if a process does."""

import argparse
import json
import logging
import os
import signal
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from multiprocessing import active_children
from pathlib import Path
from typing import NoReturn

import pytest

from benchmarks.replay import write_log
from deconflict.settings.site import DEFAULT
from deconflict.simulation.demo.demo_site import demo_site
from metrics import replay_processes
from metrics.replay_files import LogError, ReplayFiles
from metrics.replay_processes import ReplayTask
from tests.helpers.commands import run
from tests.metrics.replay.made_replays import log_of_a_crossing

CLEARANCES_M = "0.3", "0.9"
"""Far enough apart that robots come near within the second and not within the first."""
VARIANTS = "--variant", "now", "--variant", "soon", "confirm=[1, 1]"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quarter of a minute of the demo's vendors."""
    path = tmp_path_factory.mktemp("processes") / "log.jsonl"
    write_log(path, 16, 16.0)
    return path


def written(folder: Path, *words: str | Path, files: tuple[str, ...] = ("advisories", "situations")) -> dict[str, str]:
    """The files that a replay writes, with its scores without how fast they came, by name."""
    folder.mkdir()
    options = [argument for name in files for argument in (f"--{name}", folder / name)]
    run("replay", *words, "--site", demo_site(), "--json", folder / "scores.json", *options)
    found = {file.name: file.read_bytes().decode("latin-1") for file in folder.iterdir()}
    assert all(found.values()), "a log of which nothing is published proves nothing"
    scores = {name: text for name, text in found.items() if name.startswith("scores")}
    return found | {name: json.dumps(json.loads(text) | {"speed_x_real_time": None}) for name, text in scores.items()}


@pytest.mark.parametrize("files", [("advisories", "situations"), ("advisories", "situations", "mcap")])
def test_several_processes_write_the_files_of_one(log: Path, tmp_path: Path, files: tuple[str, ...]) -> None:
    in_two, in_one = (
        written(tmp_path / jobs, log, "--clearance", *CLEARANCES_M, *VARIANTS, "--jobs", jobs, files=files)
        for jobs in "21"
    )
    assert in_two == in_one
    assert in_one["scores-now.json"] != in_one["scores-soon.json"]
    result = json.loads(in_one["scores-now.json"])
    assert [score["clearance_m"] for score in result["scores"]] == [0.3, 0.9]
    assert any(scene["separation_m"] > 0.4 for scene in result["nearest"]), "near only for the wider clearance"
    assert not active_children()


@pytest.mark.parametrize("jobs", ["1", "3"])
def test_each_log_and_variant_has_the_files_of_a_replay_of_its_own(log: Path, tmp_path: Path, jobs: str) -> None:
    lines = log.read_text().splitlines(keepends=True)
    logs = [tmp_path / "monday", tmp_path / "tuesday.jsonl"]
    logs[0].mkdir()
    (logs[0] / "log.jsonl").write_text(log.read_text())
    logs[1].write_text("".join(lines[:-5]))
    variants = ("--variant", "now", "--variant", "wide", "clearance=0.9", "confirm=[1, 1]")
    found = written(tmp_path / "each", *logs, "--each", *variants, "--jobs", jobs)
    changes = {"now": (), "wide": ("--set", "clearance=0.9", "--set", "confirm=[1, 1]")}
    for path in logs:
        for variant, options in changes.items():
            name = f"{path.stem}-{variant}"
            alone = written(tmp_path / name, path, *options, "--jobs", "1")
            for file, text in alone.items():
                assert found.pop(f"{Path(file).stem}-{name}{Path(file).suffix}") == text
    assert not found


def test_of_one_log_by_itself_the_files_have_the_names_as_given(log: Path, tmp_path: Path) -> None:
    found = written(tmp_path / "one", log, "--each", "--variant", "wide", "clearance=0.9", files=("advisories", "html"))
    assert found.keys() == {"scores.json", "advisories", "html"}
    assert ": replay of log.jsonl (wide)</title>" in found["html"]
    assert json.loads(found["scores.json"])["scores"][0]["clearance_m"] == 0.9


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("a.jsonl", "b.jsonl", "--each"), "name their files with --json or --html"),
        (("a.jsonl", "--variant", "x", "--variant", "y"), "name their files with --json or --html"),
        (("a.jsonl", "--variant", "clearance=0.5"), "names no variant: give a name first"),
        (("a.jsonl", "a.jsonl", "--each", "--json", "out.json"), r"out-a\.json is named for two outputs"),
        (("a.jsonl", "b.jsonl", "--each", "--json", "b.jsonl", "--html", "b"), "can't be written|is a log"),
    ],
)
def test_results_that_would_have_no_file_of_their_own_are_refused_before_a_log_is_read(
    tmp_path: Path, words: tuple[str, ...], problem: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_processes, "run_task", lambda *_: pytest.fail("it was read"))
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b", "b-a", "b-b"):
        log_of_a_crossing(tmp_path / f"{name}.jsonl")
    (tmp_path / "b-a").mkdir()
    with pytest.raises(LogError, match=problem):
        run("replay", *words)


@pytest.mark.parametrize(
    ("options", "cores", "processes"),
    [
        (("--clearance", *CLEARANCES_M), 4, 1),
        (("--clearance", *CLEARANCES_M, "--jobs", "4"), 4, 1),
        (VARIANTS, 4, 2),
        (VARIANTS, 1, 1),
        ((*VARIANTS, "--jobs", "1"), 4, 1),
        ((*VARIANTS, "--jobs", "2"), 1, 2),
    ],
)
def test_there_are_as_many_processes_as_replays_on_the_cores_and_clearances_share_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], cores: int, processes: int
) -> None:
    log, pools = log_of_a_crossing(tmp_path / "log.jsonl"), list[int]()
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)))

    def pool(jobs: int) -> AbstractContextManager[Executor]:
        pools.append(jobs)
        return ThreadPoolExecutor()

    monkeypatch.setattr(replay_processes, "_pool", pool)
    run("replay", log, *options, "--json", tmp_path / "out.json")
    assert pools == ([processes] if processes > 1 else [])


@pytest.mark.parametrize(
    ("options", "warning"),
    [
        ((), None),
        (("--jobs", "1"), None),
        (VARIANTS, None),
        ((*VARIANTS, "--jobs", "2"), None),
        (("--jobs", "2"), "--jobs makes one replay no faster: give several logs with --each, or several --variant"),
        (("--jobs", "2", "--clearance", *CLEARANCES_M), "--jobs makes one replay no faster"),
        ((*VARIANTS, *VARIANTS[:2], "--jobs", "3"), "--jobs 3 is more than the cores that this command may use (2)"),
        ((*VARIANTS, "--jobs", "3"), None),
        ((*VARIANTS, "--scheduler"), "--scheduler without an address is slower than --jobs, which uses the same cores"),
        (("--scheduler", "tls://hall:8786"), "--scheduler makes one replay no faster"),
        ((*VARIANTS, "--scheduler", "tls://hall:8786"), None),
    ],
)
def test_what_makes_nothing_faster_is_said_in_one_line(
    options: tuple[str, ...], warning: str | None, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    command = argparse.ArgumentParser()
    command.add_argument("--variant", action="append", nargs="+", default=[])
    command.add_argument("--clearance", nargs="+")
    replay_processes.add_processes(command)
    args = command.parse_args(options)
    for place in ("_pool", "_cluster"):
        monkeypatch.setattr(replay_processes, place, lambda _: ThreadPoolExecutor())
    outputs = ReplayFiles(None, None, {}, None, None, None)
    tasks = [ReplayTask([], [], "", DEFAULT, [0.3], outputs)] * max(len(args.variant), 1)
    monkeypatch.setattr(replay_processes, "run_task", lambda *_: None)
    with replay_processes.replayed(args, tasks, lambda *_: nullcontext(iter(()))) as outcomes:
        assert len(list(outcomes)) == len(tasks)
    warnings = [record.message for record in caplog.records if record.levelno == logging.WARNING]
    assert len(warnings) == bool(warning)
    assert all(warning in line and "\n" not in line for line in warnings if warning)


def end_at_once(*_: object) -> NoReturn:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def fail(*_: object) -> NoReturn:
    raise OSError("the disk is gone")


def test_a_replay_ends_with_a_process_that_is_killed(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_processes, "run_task", end_at_once)
    with pytest.raises(LogError, match=r"was killed before it had a result.*--jobs 1 runs all in one process"):
        run("replay", log, *VARIANTS, "--json", "/dev/null", "--jobs", "2")
    assert not active_children()


def test_an_error_of_one_replay_ends_all(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_processes, "run_task", fail)
    with pytest.raises(OSError, match="the disk is gone"):
        run("replay", log, *VARIANTS, "--json", "/dev/null", "--jobs", "2")
    assert not active_children()
