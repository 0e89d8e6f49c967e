"""The roles of the service: each as a process of its own, or all in one."""

import asyncio
import logging
import os
import shutil
import tempfile
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from deconflict.cluster.nats.nats_credentials import credentials
from deconflict.operator.http.api_sources import Exposition
from deconflict.roles.role_files import (
    ALONE_FILE,
    PreparationProgress,
    early_end,
    restarts,
    role_processes,
    stands_alone,
)
from deconflict.runtime.heartbeat import Heartbeat
from deconflict.runtime.kernel_preparation import compile_kernels
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import SITE_FILE
from deconflict.settings.site import Site

if TYPE_CHECKING:
    from deconflict.roles.engine_role import EngineRole, MakeJudge
    from deconflict.roles.operator_role import OperatorRole
    from deconflict.roles.receiver_role import ReceiverRole

log = logging.getLogger(__name__)


IN_MEMORY = Path("/dev/shm")  # noqa: S108 - only this user can enter what is made there


def runtime_directory() -> tempfile.TemporaryDirectory[str]:
    """A directory for sockets that only this user can enter, with a path short enough for a Unix socket.

    It is in memory where possible: the service needs it also if every disk is full.
    """
    parent = IN_MEMORY if os.access(IN_MEMORY, os.W_OK | os.X_OK) else None
    return tempfile.TemporaryDirectory(prefix="deconflict-", dir=parent)


@asynccontextmanager
async def run_in_one_process(
    site: Site,
    data: Path,
    exposition: Exposition,
    wall: Callable[[], float] = time.time,
    make_judge: "MakeJudge | None" = None,
) -> AsyncIterator[tuple["ReceiverRole", "OperatorRole"]]:
    """Run the three roles on one event loop, the engine on a thread of its own: for tests and small runs."""
    from deconflict.roles.operator_role import OperatorRole  # noqa: PLC0415 - each role loads only itself
    from deconflict.roles.receiver_role import ReceiverRole  # noqa: PLC0415 - each role loads only itself

    with runtime_directory() as name:
        runtime, stop, stop_engine = Path(name), asyncio.Event(), threading.Event()
        data.mkdir(parents=True, exist_ok=True)
        operator = OperatorRole(site, runtime, data, exposition)
        receiver = ReceiverRole(site, runtime, data / "log", wall)
        engine = _engine_role(site, runtime, make_judge)
        async with asyncio.TaskGroup() as roles:
            roles.create_task(operator.run(stop))
            roles.create_task(receiver.run(stop))
            engine_task = asyncio.create_task(asyncio.to_thread(engine.run, stop_engine))
            try:
                await asyncio.gather(receiver.ready.wait(), operator.ready.wait())
                yield receiver, operator
            finally:
                stop_engine.set()
                await engine_task
                stop.set()


def load_role(runtime: Path, role: str, beat: Callable[[], None]) -> None:
    """Load the code of a role, so that `run_role` need not. Calls `beat` while kernels are compiled."""
    if _has_no_event_loop(role, _site(runtime)):
        _engine_class(runtime, beat)
    else:
        _async_class(role)


def run_role(
    role: str, runtime: Path, data: Path, exposition: Exposition, make_judge: "MakeJudge | None" = None
) -> None:
    """Run one role as a process of its own, until the supervisor closes standard input. `make_judge` judges the
    warnings of an engine of a single machine."""
    site = _site(runtime)
    heartbeat = Heartbeat()
    if _has_no_event_loop(role, site):
        ended = threading.Event()
        heartbeat.at_end(ended.set)
        _engine_role(site, runtime, make_judge).run(ended, heartbeat.beat)
        return
    asyncio.run(_run_async_role(role, site, runtime, data, exposition, heartbeat))


def _has_no_event_loop(role: str, site: Site) -> bool:
    """Whether it is the engine of a single machine. An engine of a cluster runs on an event loop."""
    return role == "engine" and not site.cluster


def _site(runtime: Path) -> Site:
    return Site.model_validate_json((runtime / SITE_FILE).read_text())


def _engine_role(site: Site, runtime: Path, make_judge: "MakeJudge | None") -> "EngineRole":
    is_first, ended_early = restarts(role_processes(runtime)).get("engine") == 0, early_end(runtime, "engine")
    role = _engine_class(runtime)
    return role(site, runtime, is_first=is_first, ended_early=ended_early, make_judge=make_judge)


def _engine_class(runtime: Path, beat: Callable[[], object] = lambda: None) -> type["EngineRole"]:
    from ingest.kernels import before_compiling  # noqa: PLC0415 - loads numba

    progress = PreparationProgress(runtime, beat)
    with before_compiling(partial(compile_kernels, ("deconflict", "metrics"), progress.report)):
        from deconflict.roles.engine_role import EngineRole  # noqa: PLC0415 - loads kernels
    progress.end()
    return EngineRole


async def _run_async_role(
    role: str, site: Site, runtime: Path, data: Path, exposition: Exposition, heartbeat: Heartbeat
) -> None:
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    heartbeat.at_end(partial(loop.call_soon_threadsafe, stop.set))
    running = _async_role(role, site, runtime, data, exposition)
    tasks = [asyncio.create_task(heartbeat.keep_beating())]
    if ready := getattr(running, "ready", None):  # it has a port
        tasks.append(asyncio.create_task(_report_port_open(ready, heartbeat)))
    try:
        await running.run(stop)
    finally:
        for task in tasks:
            task.cancel()


async def _report_port_open(ready: asyncio.Event, heartbeat: Heartbeat) -> None:
    await ready.wait()
    heartbeat.report_port_open()


def _async_role(role: str, site: Site, runtime: Path, data: Path, exposition: Exposition) -> "Role":
    if role == "operator" and stands_alone(runtime):
        site, data = _alone(site, runtime, data)
    arguments: dict[str, tuple[object, ...]] = {
        "receiver": (runtime, data / "log"),
        "operator": (runtime, data, exposition),
        "feed": (site.cluster, runtime, data / "log"),
        "engine": (site.cluster, runtime, early_end(runtime, "engine")),
    }
    return _async_class(role)(site, *arguments.get(role, (site.cluster, runtime)))


def _alone(site: Site, runtime: Path, data: Path) -> tuple[Site, Path]:
    """The settings and the data directory of an operator face while no NATS server is connected.

    Its engine writes everything to the stream later, so what the face stored the last time is removed.
    """
    data, begun = data / ALONE_FILE, runtime / ALONE_FILE
    if not begun.read_text():
        shutil.rmtree(data, ignore_errors=True)
    with suppress(OSError):  # a face needs no disk
        data.mkdir(exist_ok=True)
    begun.write_text("begun")
    recorder = site.recorder.model_copy(update={"enabled": False})
    return site.model_copy(update={"cluster": None, "recorder": recorder}), data


def _async_class(role: str) -> Callable[..., "Role"]:
    """The class of a role that runs on an event loop."""
    if role == "receiver":
        from deconflict.roles.receiver_role import ReceiverRole  # noqa: PLC0415 - the supervisor needs no role

        return ReceiverRole
    if role == "operator":
        from deconflict.roles.operator_role import OperatorRole  # noqa: PLC0415 - the supervisor needs no role

        return OperatorRole
    from deconflict.cluster.engine_member import EngineMember  # noqa: PLC0415 - brings the NATS client
    from deconflict.cluster.ingest_feed import IngestFeed  # noqa: PLC0415 - brings the NATS client
    from deconflict.cluster.store_follower import StoreFollower  # noqa: PLC0415 - brings the NATS client

    classes: dict[str, Callable[..., Role]] = {"feed": IngestFeed, "follower": StoreFollower, "engine": EngineMember}
    return classes[role]


def cluster_problems(settings: Cluster | None, parts: Iterable[str]) -> list[str]:
    """A sentence for each reason why a cluster, or single parts of the service, can't run.

    Raises `SecretError` and `CertificateError` if the credentials for NATS can't be used.
    """
    if settings is None:
        return (
            ["cluster.nats: is missing; --part needs a cluster, in which other machines run the rest"] if parts else []
        )
    if find_spec("nats") is None:
        return ["cluster.nats: needs the NATS client; pip install 'amr-deconflict[cluster]'"]
    credentials(settings)
    return []


class Role(Protocol):
    """A role that runs on an event loop."""

    async def run(self, stop: asyncio.Event) -> None: ...
