"""Replays on a real Dask cluster give the results of one process."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import NoReturn

import pytest

from benchmarks.replay import write_log
from deconflict.simulation.demo.demo_site import demo_site
from metrics import replay_processes
from metrics.replay_files import LogError
from metrics.replay_processes import Outcome, ReplayTask, run_task
from tests.helpers.commands import run

pytest.importorskip("dask.distributed", reason="Dask is not installed: pip install '.[dask]'")

from dask.distributed import Client

Replay = Callable[..., dict[str, str]]
VARIANTS = "--variant", "near", "clearance=0.3", "--variant", "wide", "clearance=0.9"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quarter of a minute of the demo's vendors."""
    path = tmp_path_factory.mktemp("spread") / "log.jsonl"
    write_log(path, 16, 16.0)
    return path


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with replay_processes.cluster("") as subscriber:
        yield subscriber


@pytest.fixture
def replayed(log: Path, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Replay:
    """Replays with two settings, and gives all files, without how fast they came."""
    monkeypatch.setattr(replay_processes, "cluster", lambda _: nullcontext(client))

    def replay(*options: str) -> dict[str, str]:
        scores, files = (
            tmp_path / "scores.json",
            ("--advisories", tmp_path / "out", "--situations", tmp_path / "people"),
        )
        run("replay", log, "--site", demo_site(), *VARIANTS, "--json", scores, *files, *options)
        for path in tmp_path.glob("scores-*.json"):
            path.write_text(json.dumps(json.loads(path.read_text()) | {"speed_x_real_time": None}))
        found = {path.name: path.read_text() for path in tmp_path.glob("[!.]*") if path.is_file()}
        assert all(found.values()), "a log of which nothing is published proves nothing"
        for name in found:
            (tmp_path / name).unlink()
        return found

    return replay


def test_a_cluster_gives_what_one_process_gives(replayed: Replay) -> None:
    assert replayed("--scheduler") == replayed("--jobs", "1")


def test_a_worker_that_dies_does_not_change_the_result(
    replayed: Replay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    died = tmp_path / ".died"
    monkeypatch.setattr(replay_processes, "run_task", partial(die_once, died))
    on_cluster = replayed("--scheduler")
    assert died.exists()
    monkeypatch.setattr(replay_processes, "run_task", run_task)
    assert on_cluster == replayed("--jobs", "1")


def die_once(died: Path, task: ReplayTask) -> Outcome:
    """Run the task, and after that end the worker if none has ended yet."""
    outcome = run_task(task)
    try:
        died.touch(exist_ok=False)
    except FileExistsError:
        return outcome
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def test_the_command_says_when_workers_are_killed_again_and_again(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_processes, "run_task", die)
    with replay_processes.cluster("") as client:
        client.run_on_scheduler(allow_no_failure)  # type: ignore[no-untyped-call]
        monkeypatch.setattr(replay_processes, "cluster", lambda _: nullcontext(client))
        with pytest.raises(LogError, match="workers were killed, mostly for lack of memory: give each more"):
            run("replay", log, "--scheduler")


def allow_no_failure(dask_scheduler: object) -> None:
    dask_scheduler.allowed_failures = 0  # type: ignore[attr-defined]


def die(_: ReplayTask) -> NoReturn:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def test_the_command_says_when_a_worker_does_not_have_the_log(
    replayed: Replay, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_processes, "run_task", find_no_log)
    with pytest.raises(
        LogError, match=r"can't read log\.jsonl \(No such file\): give a path that all its machines share"
    ):
        replayed("--scheduler")


def find_no_log(_: ReplayTask) -> NoReturn:
    raise FileNotFoundError(2, "No such file", "log.jsonl")


@pytest.mark.parametrize("address", ["tcp://10.0.0.9:8786", "scheduler.example:8786", "ws://10.0.0.9:8786"])
def test_a_scheduler_that_anybody_could_send_code_is_not_used(log: Path, address: str) -> None:
    with pytest.raises(LogError, match="takes code from anybody who reaches it"):
        run("replay", log, "--scheduler", address)


def test_the_cluster_of_this_machine_takes_no_code_without_its_certificate() -> None:
    with replay_processes.cluster("") as client:
        address = client.scheduler_info()["address"]
        assert address.startswith("tls://")
        with pytest.raises((OSError, TimeoutError)):
            Client(address.replace("tls://", "tcp://"), timeout=3)  # type: ignore[no-untyped-call]


def test_the_command_says_when_no_scheduler_answers(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_processes, "CONNECT_TIMEOUT_S", 0.2)
    with pytest.raises(LogError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run("replay", log, "--scheduler", "tcp://127.0.0.1:9")
