"""A replay in several processes gives the bytes of a replay in one, and ends if a process does."""

import json
import os
import signal
from collections.abc import Iterator
from multiprocessing import active_children
from pathlib import Path

import pytest

from benchmarks.replay import write_log
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from ingest.recording.log_reader import Event, LogReader
from metrics.replay import parallel_replay
from metrics.replay.engine_run import EngineRun
from metrics.replay.parallel_replay import ReplayProcessError
from metrics.replay.replay import replay
from tests.helpers.commands import run
from tests.metrics.replay.made_replays import log_of_a_crossing

FILES = "advisories", "situations", "mcap"
UNTIL_THEY_MEET = 2 + 2 * 13
"""Lines of the log of a crossing."""
KILLED_AFTER = 40
"""Events of the log, of which there are far more."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quarter of a minute of the demo's vendors."""
    path = tmp_path_factory.mktemp("parallel") / "log.jsonl"
    write_log(path, 16, 16.0)
    return path


@pytest.fixture(scope="module")
def site() -> Site:
    return load(demo_site())


def outputs(log: Path, folder: Path, jobs: int) -> dict[str, object]:
    """The files that the command writes, and its scores without how fast they came."""
    folder.mkdir()
    paths = {name: folder / name for name in FILES}
    options = [argument for name, path in paths.items() for argument in (f"--{name}", path)]
    scores, clearances = folder / "scores.json", ("--clearance", "0.3", "0.5")
    run("replay", log, "--site", demo_site(), "--jobs", str(jobs), *clearances, "--json", scores, *options)
    files = {file.name: file.read_bytes() for file in folder.iterdir() if file != scores}
    assert all(files.values()), "a log of which nothing is published proves nothing"
    return {**files, "scores": json.dumps(json.loads(scores.read_text()) | {"speed_x_real_time": None})}


def test_several_processes_write_the_files_of_one(log: Path, tmp_path: Path) -> None:
    assert outputs(log, tmp_path / "several", 2) == outputs(log, tmp_path / "one", 1)
    assert not active_children()


def test_a_log_that_ends_while_round_robots_meet_is_scored_by_their_shapes(tmp_path: Path) -> None:
    """Each process numbers shapes by itself. Only the one that scores knows these."""
    log, file = log_of_a_crossing(tmp_path / "log.jsonl"), tmp_path / "site.toml"
    file.write_text('[[vendors]]\nname = "Alder"\n[vendors.models.A1]\nshape = "circle"\ndiameter_m = 0.7321\n')
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:UNTIL_THEY_MEET]))
    results = []
    for replayed in (parallel_replay.replay, replay):
        reader = LogReader()
        results.append(replayed(reader, reader.read([log]), load(file), [0.3]) | {"speed_x_real_time": None})
    several, in_one = results
    assert several == in_one
    assert several["nearest"][0]["separation_m"] < 0.3


@pytest.mark.parametrize("name", ["engine", "scoring"])
def test_a_replay_ends_with_a_process_that_is_killed(
    log: Path, site: Site, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parallel_replay, "GROUP_PASSES", 1)
    reader = LogReader()

    def events() -> Iterator[Event]:
        for number, event in enumerate(reader.read([log])):
            if number == KILLED_AFTER:
                os.kill(next(child.pid or 0 for child in active_children() if name in child.name), signal.SIGKILL)
            yield event

    with pytest.raises(ReplayProcessError, match=f"for {name}.* was ended by SIGKILL.*--jobs 1"):
        parallel_replay.replay(reader, events(), site, [0.3])
    assert not active_children()


def test_an_error_in_an_engine_ends_the_replay(log: Path, site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(EngineRun, "advance", None)
    reader = LogReader()
    with pytest.raises(ReplayProcessError, match=r"for engine at 0\.3 m was ended with an error"):
        parallel_replay.replay(reader, reader.read([log]), site, [0.3])


def test_an_error_in_the_log_ends_all_processes(site: Site) -> None:
    def events() -> Iterator[Event]:
        yield from ()
        raise OSError("the disk is gone")

    with pytest.raises(OSError, match="the disk is gone"):
        parallel_replay.replay(LogReader(), events(), site, [0.3])
    assert not active_children()
