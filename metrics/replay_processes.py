"""Many replays side by side, each whole in one process: on the cores of this machine, or on a Dask cluster.

A task is one log with one setting, at all its clearances: these share the reading of the log, so that dividing them
costs more than it gains.
"""

import argparse
import logging
import os
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from deconflict.operator.blackbox.start_state import StartState, head_of, start_of
from deconflict.runtime.command_parsers import MOST_JOBS, whole_in
from deconflict.runtime.worker_process import end_with_command
from deconflict.settings.site import Site
from ingest.recording.log_reader import Event, LogReader
from ingest.security.origin_check import is_loopback
from metrics.replay_files import LogError, ReplayFiles

if TYPE_CHECKING:
    from dask.distributed import Client

CONNECT_TIMEOUT_S = 10.0
DASHBOARD = ":0"
"""Any free port, because another replay may run on the same machine. Dask serves it even without bokeh."""
FORK = get_context("fork")
"""Workers share the memory of the code and of its compiled kernels, and log as this process does."""
Outcome = tuple[dict[str, Any], LogReader]
"""The result of a replay, and the reader of its log."""
Reading = Callable[[LogReader, Sequence[Path]], AbstractContextManager[Iterator[Event]]]
_REPLAY = Lock()
"""Held while a replay runs. A worker of a cluster may have several threads."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ReplayTask:
    """One log with one setting."""

    logs: Sequence[Path]
    """As they are named on the command line. They are replayed as one log."""
    files: Sequence[Path]
    """Those of the logs, by time."""
    variant: str
    """Name of the setting; may be empty."""
    site: Site
    clearances_m: Sequence[float]
    outputs: ReplayFiles


def add_processes(command: argparse.ArgumentParser) -> None:
    """Add the options that say where replays run."""
    command.add_argument(
        "--jobs",
        type=whole_in(1, MOST_JOBS),
        metavar="N",
        help="replays at once: each log with --each, and each variant, is one, in a process of its own "
        "(default: as many as there are, at most the cores that this command may use)",
    )
    command.add_argument(
        "--scheduler",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="run them on a Dask cluster, which reads and writes files under the same names; "
        "without an address, on the cores of this machine",
    )


@contextmanager
def replayed(args: argparse.Namespace, tasks: Sequence[ReplayTask], reading: Reading) -> Iterator[Iterator[Outcome]]:
    """The outcomes of the tasks, in their order. `reading` reads a log in this process. Raises `LogError`."""
    cores = len(os.sched_getaffinity(0))
    if slower := _slower(args, len(tasks), cores):
        log.warning(slower)
    processes = min(args.jobs or cores, len(tasks))
    if args.scheduler is None and processes == 1:
        yield (run_task(task, reading) for task in tasks)
        return
    with _pool(processes) if args.scheduler is None else _cluster(args.scheduler) as executor:
        futures = deque(executor.submit(run_task, task) for task in tasks)
        yield (futures.popleft().result() for _ in tasks)


def _slower(args: argparse.Namespace, replays: int, cores: int) -> str | None:
    """What the options ask for that makes nothing faster, and what to do instead."""
    jobs = args.jobs or 1
    if args.scheduler == "":
        return "--scheduler without an address is slower than --jobs, which uses the same cores: leave it out"
    if replays == 1 and (args.scheduler or jobs > 1):
        option = "--scheduler" if args.scheduler else "--jobs"
        return f"{option} makes one replay no faster: give several logs with --each, or several --variant"
    if not args.scheduler and cores < jobs <= replays:
        return f"--jobs {jobs} is more than the cores that this command may use ({cores}): leave it out"
    return None


def run_task(task: ReplayTask, reading: Reading = lambda reader, files: nullcontext(reader.read(files))) -> Outcome:
    """Replay a task in this process, and write what it publishes."""
    from metrics.replay.replay import replay  # noqa: PLC0415 - brings kernels

    start = start_of(head) if (head := head_of_only(task.logs)) else StartState()
    reader = LogReader()
    with _REPLAY, ExitStack() as files:
        sinks = task.outputs.sinks(files)
        events = files.enter_context(reading(reader, task.files))
        result = replay(reader, events, task.site, task.clearances_m, start=start, **sinks)
    return result, reader


def head_of_only(logs: Sequence[Path]) -> dict[str, Any] | None:
    """The head of the only log, if that is a black box; else None."""
    return head_of(logs[0]) if len(logs) == 1 else None


@contextmanager
def _pool(jobs: int) -> Iterator[Executor]:
    pool = ProcessPoolExecutor(jobs, FORK, end_with_command)
    try:
        yield pool
    except BrokenProcessPool as error:
        raise LogError(
            "a process of the replay was killed before it had a result, mostly for lack of memory: fewer --jobs need "
            "less, and --jobs 1 runs all in one process"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    try:
        from dask.distributed import KilledWorker  # noqa: PLC0415 - Dask is optional
    except ImportError as error:
        raise LogError(f"--scheduler needs Dask ({error}): pip install '.[dask]'") from error
    try:
        with cluster(address) as client:
            yield client.get_executor(pure=False)  # type: ignore[no-untyped-call]
    except KilledWorker as error:
        raise LogError(f"workers were killed, mostly for lack of memory: give each more ({error})") from error
    except (FileNotFoundError, PermissionError) as error:
        problem = f"a worker of the cluster can't read {error.filename} ({error.strerror})"
        raise LogError(f"{problem}: give a path that all its machines share") from error


@contextmanager
def cluster(address: str) -> "Iterator[Client]":
    """A client of the scheduler at an address. If the address is empty, starts a cluster on this machine's cores.
    Raises `LogError`."""
    from dask.distributed import Client, LocalCluster, Security  # noqa: PLC0415 - Dask is optional

    logging.getLogger("distributed").setLevel(logging.ERROR)
    if address:
        _refuse_open(address)
        try:
            client = Client(address, timeout=CONNECT_TIMEOUT_S)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise LogError(f"no Dask scheduler answers at {address}: start one with `dask scheduler`") from error
        with client:
            yield client
        return
    security = Security.temporary()  # type: ignore[no-untyped-call]
    with (
        LocalCluster(  # type: ignore[no-untyped-call]
            threads_per_worker=1, dashboard_address=DASHBOARD, protocol="tls://", security=security
        ) as local,
        Client(local, security=security) as client,  # type: ignore[no-untyped-call]
    ):
        if find_spec("bokeh"):
            sys.stderr.write(f"dashboard: {client.dashboard_link}\n")
        yield client


def _refuse_open(address: str) -> None:
    """Raises `LogError` for a scheduler to which anybody on the network could send code to run."""
    host = urlsplit(address if "//" in address else f"tcp://{address}").hostname or ""
    if not (address.startswith("tls://") or is_loopback(host)):
        raise LogError(
            f"{address} takes code from anybody who reaches it: start scheduler and workers with certificates "
            "(https://distributed.dask.org/en/stable/tls.html), and use tls://HOST:PORT"
        )
