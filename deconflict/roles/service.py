"""The roles of the service: each as a process of its own, or all in one."""

import asyncio
import logging
import tempfile
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from deconflict.cluster.nats.nats_credentials import credentials
from deconflict.operator.http.api import Exposition
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.receiver_role import ReceiverRole
from deconflict.runtime.heartbeat import Lifeline
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.hot_reload import SITE_FILE
from deconflict.settings.site import Site

if TYPE_CHECKING:
    from deconflict.roles.engine_role import EngineRole

log = logging.getLogger(__name__)


def runtime_directory() -> tempfile.TemporaryDirectory[str]:
    """A directory for links that only this user can enter, with a path short enough for a Unix socket."""
    return tempfile.TemporaryDirectory(prefix="deconflict-")


@asynccontextmanager
async def in_one_process(
    site: Site, data: Path, exposition: Exposition, wall: Callable[[], float] = time.time
) -> AsyncIterator[tuple[ReceiverRole, OperatorRole]]:
    """The same three roles on one event loop, the engine on a thread: for tests and small runs."""
    with runtime_directory() as name:
        runtime, stop, stop_engine = Path(name), asyncio.Event(), threading.Event()
        data.mkdir(parents=True, exist_ok=True)
        operator = OperatorRole(site, runtime, data, exposition)
        receiver = ReceiverRole(site, runtime, data / "log", wall)
        engine = _engine_role(site, runtime)
        async with asyncio.TaskGroup() as roles:
            roles.create_task(operator.run(stop))
            roles.create_task(receiver.run(stop))
            computing = asyncio.create_task(asyncio.to_thread(engine.run, stop_engine))
            try:
                await asyncio.gather(receiver.ready.wait(), operator.ready.wait())
                yield receiver, operator
            finally:
                stop_engine.set()
                await computing
                stop.set()


def _engine_role(site: Site, runtime: Path) -> "EngineRole":
    from deconflict.roles.engine_role import EngineRole  # noqa: PLC0415 - brings numba

    return EngineRole(site, runtime)


def run_role(role: str, runtime: Path, data: Path, exposition: Exposition) -> None:
    """Be one role until standard input ends, as a supervisor's child."""
    site = Site.model_validate_json((runtime / SITE_FILE).read_text())
    line = Lifeline()
    if role == "engine" and not site.cluster:
        ended = threading.Event()
        line.at_end(ended.set)
        _engine_role(site, runtime).run(ended, line.goes_on)
        return
    asyncio.run(_run_async_role(role, site, runtime, data, exposition, line))


async def _run_async_role(
    role: str, site: Site, runtime: Path, data: Path, exposition: Exposition, line: Lifeline
) -> None:
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    line.at_end(partial(loop.call_soon_threadsafe, stop.set))
    one = _async_role(role, site, runtime, data, exposition)
    telling = [asyncio.create_task(line.speaking())]
    if isinstance(one, ReceiverRole | OperatorRole):
        telling.append(asyncio.create_task(_serves(one.ready, line)))
    try:
        await one.run(stop)
    finally:
        for task in telling:
            task.cancel()


async def _serves(ready: asyncio.Event, line: Lifeline) -> None:
    await ready.wait()
    line.serves()


def _async_role(role: str, site: Site, runtime: Path, data: Path, exposition: Exposition) -> "Runs":
    if role == "receiver":
        return ReceiverRole(site, runtime, data / "log")
    if role == "operator" or not site.cluster:
        return OperatorRole(site, runtime, data, exposition)
    return _cluster_role(role, site, site.cluster, runtime)


def cluster_problems(settings: Cluster | None, parts: Iterable[str]) -> list[str]:
    """Why parts can't be run by themselves, or a cluster can't be, a sentence each.

    Raises `SecretError` and `CertificateError` where it can't sign in.
    """
    if settings is None:
        return ["cluster.nats: is missing; --part needs other machines to run the other parts"] if parts else []
    if find_spec("nats") is None:
        return ["cluster.nats: needs the NATS client; pip install 'amr-deconflict[cluster]'"]
    credentials(settings)
    return []


class Runs(Protocol):
    async def run(self, stop: asyncio.Event) -> None: ...


def _cluster_role(role: str, site: Site, settings: Cluster, runtime: Path) -> Runs:
    from deconflict.cluster.engine_member import Member  # noqa: PLC0415 - brings the NATS client
    from deconflict.cluster.ingest_feed import Feed  # noqa: PLC0415 - brings the NATS client
    from deconflict.cluster.store_follower import Follower  # noqa: PLC0415 - brings the NATS client

    if role == "feed":
        return Feed(site, settings, runtime)
    return Follower(site, settings, runtime) if role == "follower" else Member(site, settings, runtime)
