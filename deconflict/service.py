"""The whole service: one process a role, watched and restarted; or all roles in one process."""

import asyncio
import json
import logging
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from deconflict.cluster.settings import Cluster
from deconflict.operator import Exposition
from deconflict.reloading import SITE_FILE, Reloader, write
from deconflict.roles.operator import ROLES_FILE, OperatorRole
from deconflict.roles.receiver import ReceiverRole
from deconflict.site import Site

if TYPE_CHECKING:
    from deconflict.roles.engine import EngineRole

log = logging.getLogger(__name__)

PARTS = {"face": ("operator",), "ingest": ("receiver",), "engine": ("engine",)}
"""The parts of the service, and the roles of each, in the order in which they start."""
CLUSTER_PARTS = {"face": ("operator", "follower"), "ingest": ("receiver", "feed"), "engine": ("engine",)}
"""The same where several machines share the work; each runs the parts that it is told to."""
STOP_WITHIN_S = 10.0
BACKOFF_S = (0.2, 10.0)
"""First and longest wait before a role that keeps dying is started again; the first time it is at once."""
STEADY_S = 10.0
"""A role that ran for this long does not keep dying."""


@dataclass(slots=True, eq=False)
class Watched:
    """One role's process. It ends when its standard input does, so it never outlives its supervisor."""

    role: str
    command: list[str]
    process: subprocess.Popen[bytes] | None = None
    restarts: int = 0
    started_s: float = field(default=float("-inf"))
    backoff_s: float = 0.0
    due_s: float = float("-inf")

    def ensure(self, now_s: float) -> bool:
        """Start or restart the process if it is not running and due; whether it ended or began."""
        if self.process and self.process.poll() is None:
            return False
        ended = self.process is not None
        if self.process:
            self._ended(now_s, self.process)
        if now_s < self.due_s:
            return ended
        self.process = subprocess.Popen(self.command, stdin=subprocess.PIPE, start_new_session=True)  # noqa: S603
        self.started_s = now_s
        return True

    def _ended(self, now_s: float, process: subprocess.Popen[bytes]) -> None:
        if now_s - self.started_s > STEADY_S:
            self.backoff_s = 0.0
        log.warning(
            "the %s ended with code %s and is restarted in %.1f s", self.role, process.returncode, self.backoff_s
        )
        self.due_s = now_s + self.backoff_s
        self.backoff_s = min(max(2 * self.backoff_s, BACKOFF_S[0]), BACKOFF_S[1])
        self.restarts += 1
        if process.stdin:
            process.stdin.close()
        self.process = None

    def told(self) -> dict[str, float | None]:
        """What the other roles are told of this one: how often it was restarted, and since when it runs, if it does."""
        return {"restarts": self.restarts, "since_s": self.started_s if self.process else None}

    def stop(self) -> None:
        if self.process is None:
            return
        if self.process.stdin:
            self.process.stdin.close()
        try:
            self.process.wait(STOP_WITHIN_S)
        except subprocess.TimeoutExpired:
            log.warning("the %s did not stop in %s s and is killed", self.role, STOP_WITHIN_S)
            self.process.kill()
            self.process.wait()


class Supervisor:
    """Keeps a process for each role running."""

    def __init__(
        self,
        site: Site,
        data: Path,
        runtime: Path,
        read: Callable[[], Site] | None = None,
        parts: Iterable[str] = PARTS,
    ) -> None:
        """`read` reads the site again for `Reloader`; without it there is nothing to read."""
        roles = chain.from_iterable((CLUSTER_PARTS if site.cluster else PARTS)[part] for part in parts)
        self._runtime = runtime
        self.reloader = Reloader(site, read or (lambda: site), runtime)
        self.roles = [
            Watched(role, [sys.executable, "-m", "deconflict", "role", role, str(runtime), str(data)]) for role in roles
        ]

    def run(self, stop: threading.Event) -> None:
        """Watch the roles until `stop` is set, then end them."""
        try:
            while not stop.is_set():
                changed = [role.role for role in self.roles if role.ensure(time.monotonic())]
                if changed:
                    self._tell()
                self.reloader.look()
                stop.wait(0.1)
        finally:
            for role in reversed(self.roles):
                role.stop()

    def _tell(self) -> None:
        write(self._runtime / ROLES_FILE, json.dumps({role.role: role.told() for role in self.roles}))


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
    from deconflict.roles.engine import EngineRole  # noqa: PLC0415 - brings numba, which no other role needs

    return EngineRole(site, runtime)


def run_role(role: str, runtime: Path, data: Path, exposition: Exposition) -> None:
    """Be one role until standard input ends, as a supervisor's child."""
    site = Site.model_validate_json((runtime / SITE_FILE).read_text())
    if role == "engine" and not site.cluster:
        ended = threading.Event()
        threading.Thread(target=_call_at_end_of_input, args=(ended.set,), daemon=True).start()
        _engine_role(site, runtime).run(ended)
        return
    asyncio.run(_run_async_role(role, site, runtime, data, exposition))


async def _run_async_role(role: str, site: Site, runtime: Path, data: Path, exposition: Exposition) -> None:
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    ended = partial(loop.call_soon_threadsafe, stop.set)
    threading.Thread(target=_call_at_end_of_input, args=(ended,), daemon=True).start()
    if role == "receiver":
        await ReceiverRole(site, runtime, data / "log").run(stop)
    elif role == "operator":
        await OperatorRole(site, runtime, data, exposition).run(stop)
    elif site.cluster:
        await _cluster_role(role, site, site.cluster, runtime).run(stop)


def cluster_problems(settings: Cluster | None, parts: Iterable[str]) -> list[str]:
    """Why parts can't be run by themselves, or a cluster can't be, a sentence each."""
    if settings is None:
        return ["cluster.nats: is missing; --part needs other machines to run the other parts"] if parts else []
    if find_spec("nats") is None:
        return ["cluster.nats: needs the NATS client; pip install 'amr-deconflict[cluster]'"]
    return []


class Runs(Protocol):
    async def run(self, stop: asyncio.Event) -> None: ...


def _cluster_role(role: str, site: Site, settings: Cluster, runtime: Path) -> Runs:
    from deconflict.cluster.feed import Feed  # noqa: PLC0415 - brings the NATS client, which nothing else needs
    from deconflict.cluster.follower import Follower  # noqa: PLC0415
    from deconflict.cluster.member import Member  # noqa: PLC0415

    if role == "feed":
        return Feed(site, settings, runtime)
    return Follower(site, settings, runtime) if role == "follower" else Member(site, settings)


def _call_at_end_of_input(then: Callable[[], object]) -> None:
    sys.stdin.buffer.read()
    then()
