"""A replay on a real Dask cluster gives the bytes of a single run."""

import json
import os
import signal
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from benchmarks.replay import write_log
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.sweep.shapes.shape_table import SHAPES
from ingest.recording.log_reader import LogReader
from ingest.shapes import Shape
from metrics.replay import replay
from metrics.replay_files import LogError
from tests.helpers.commands import run

pytest.importorskip("dask.distributed", reason="Dask is not installed: pip install '.[dask]'")

from dask.distributed import Client

from metrics.replay import dask_replay

CLEARANCES_M = [0.3, 0.5]
WINDOW_S = 4.0

Run = tuple[str, list[str], list[str]]
"""The scores as text, but for how fast they came, and the advisories and situations that the stream would have told."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quarter of a minute of the demo's vendors."""
    path = tmp_path_factory.mktemp("spread") / "log.jsonl"
    write_log(path, 16, 16.0)
    return path


@pytest.fixture(scope="module")
def site() -> Site:
    return load(demo_site())


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with dask_replay.cluster("") as subscriber:
        yield subscriber


@pytest.fixture(scope="module")
def alone(log: Path, site: Site) -> Run:
    reader, lines, situations = LogReader(), list[str](), list[str]()
    result = replay.replay(reader, reader.read([log]), site, CLEARANCES_M, **sinks(lines, situations))
    assert lines, "a log in which nothing is told proves nothing"
    assert situations
    return text(result), lines, situations


def sinks(lines: list[str], situations: list[str]) -> replay.Sinks:
    """Collect what the stream would have told."""
    return {
        "on_advisory": lambda clearance_m, revision: lines.append(f"{clearance_m} {revision.model_dump_json()}"),
        "on_situation": lambda revision: situations.append(revision.model_dump_json()),
    }


def text(result: dict[str, Any]) -> str:
    return json.dumps({**result, "speed_x_real_time": None})


@pytest.mark.parametrize("window_s", [3.0, 60.0])
def test_windows_of_any_length_give_what_a_single_run_gives(
    client: Client, log: Path, site: Site, alone: Run, window_s: float
) -> None:
    reader, lines, situations = LogReader(), list[str](), list[str]()
    result = dask_replay.replay(
        client,
        reader,
        reader.read([log]),
        site,
        CLEARANCES_M,
        window_s=window_s,
        **sinks(lines, situations),  # type: ignore[misc]
    )
    assert (text(result), lines, situations) == alone


def test_a_state_keeps_its_shapes_on_a_worker_that_has_numbered_others(client: Client) -> None:
    first, second = list(client.scheduler_info()["workers"])[:2]
    client.run(number_circles, [4.0, 5.0], workers=[second])
    state = client.submit(packed_circles, [0.5, 1.5], workers=[first], pure=False)
    assert client.submit(unpacked_sizes_m, state, workers=[second], pure=False).result() == [0.5, 1.5]


def number_circles(diameters_m: Sequence[float]) -> None:
    SHAPES.number_as(map(Shape.circle, diameters_m))


def packed_circles(diameters_m: Sequence[float]) -> bytes:
    """A state that holds the numbers of circles."""
    number_circles(diameters_m)
    return dask_replay._packed([1, 2])


def unpacked_sizes_m(state: bytes) -> list[float]:
    with dask_replay._unpacked(state) as numbers:
        shapes = [SHAPES[number] for number in numbers]
        return [shape.size_m[0] for shape in shapes if shape]


def test_a_worker_that_dies_does_not_change_the_result(client: Client, log: Path, site: Site, alone: Run) -> None:
    reader, killed, seen = LogReader(), list[int](), list[float]()

    def kill(now_s: float, _: object) -> None:
        seen.append(now_s)
        if not killed and now_s > seen[0] + 1.5 * WINDOW_S:
            killed.extend(list(client.run(os.getpid).values())[:1])
            os.kill(killed[0], signal.SIGKILL)

    result = dask_replay.replay(
        client, reader, reader.read([log]), site, CLEARANCES_M, on_batch=kill, window_s=WINDOW_S
    )
    assert killed
    assert text(result) == alone[0]
    assert seen == sorted(set(seen))


@pytest.mark.parametrize("address", ["tcp://10.0.0.9:8786", "scheduler.example:8786", "ws://10.0.0.9:8786"])
def test_a_scheduler_that_anybody_could_send_code_is_not_used(log: Path, address: str) -> None:
    with pytest.raises(LogError, match="takes code from anybody who reaches it"):
        run("replay", log, "--scheduler", address)


def test_the_cluster_of_this_machine_takes_no_code_without_its_certificate() -> None:
    with dask_replay.cluster("") as client:
        address = client.scheduler_info()["address"]
        assert address.startswith("tls://")
        with pytest.raises((OSError, TimeoutError)):
            Client(address.replace("tls://", "tcp://"), timeout=3)  # type: ignore[no-untyped-call]


def test_the_command_says_when_no_scheduler_answers(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_replay, "CONNECT_TIMEOUT_S", 0.2)
    with pytest.raises(LogError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run("replay", log, "--scheduler", "tcp://127.0.0.1:9")
