"""Keeps a process for each role running: one that ends is started again, one that hangs is killed first."""

import json
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from deconflict.roles.operator_role import ROLES_FILE
from deconflict.runtime.heartbeat import Watching
from deconflict.runtime.systemd import READY, STOPPING, Notifier
from deconflict.settings.hot_reload import Reloader, write
from deconflict.settings.site import Site

log = logging.getLogger(__name__)

PARTS = {"face": ("operator",), "ingest": ("receiver",), "engine": ("engine",)}
"""The parts of the service, and the roles of each, in the order in which they start."""
CLUSTER_PARTS = {"face": ("operator", "follower"), "ingest": ("receiver", "feed"), "engine": ("engine",)}
"""The same where several machines share the work; each runs the parts that it is told to."""
PORTS = ("operator", "receiver")
"""The roles that have a port for others."""
STOP_WITHIN_S = 10.0
BACKOFF_S = (0.2, 10.0)
"""First and longest wait before a role that keeps dying is started again; the first time it is at once."""
STEADY_S = 10.0
"""A role that ran for this long does not keep dying."""
MEMORY = {"MALLOC_ARENA_MAX": "2"}
"""What roles find in their environment if it is not there: glibc gives threads heaps of their own, as many as eight for
each core, and each keeps for ever the most that any work needed there. Here all threads share one."""


@dataclass(slots=True, eq=False)
class Watched:
    """One role's process. It ends when its lifeline does, so it never outlives its supervisor."""

    role: str
    command: list[str]
    process: subprocess.Popen[bytes] | None = None
    line: Watching | None = None
    restarts: int = 0
    started_s: float = field(default=float("-inf"))
    backoff_s: float = 0.0
    due_s: float = float("-inf")

    def ensure(self, now_s: float) -> bool:
        """Start or restart the process if it is not running and due, kill it if it hangs; whether it ended or began."""
        if self.process and self.line and self.process.poll() is None:
            if self.line.hangs(now_s):
                log.error("the %s hangs and is killed", self.role)
                self.process.kill()
            return False
        ended = self.process is not None
        if self.process:
            self._ended(now_s, self.process)
        if now_s < self.due_s:
            return ended
        self.line = Watching(now_s)
        self.process = subprocess.Popen(  # noqa: S603
            self.command, stdin=self.line.theirs.fileno(), start_new_session=True, env=MEMORY | os.environ
        )
        self.line.theirs.close()
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
        if self.line:
            self.line.close()
        self.process = None

    def told(self) -> dict[str, float | None]:
        """What the other roles are told of this one: how often it was restarted, and since when it runs, if it does."""
        return {"restarts": self.restarts, "since_s": self.started_s if self.process else None}

    def stop(self) -> None:
        if self.process is None:
            return
        if self.line:
            self.line.close()
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
        manager: Notifier | None = None,
    ) -> None:
        """`read` reads the site again for `Reloader`; without it there is nothing to read."""
        self._manager, self._ready = manager or Notifier({}), False
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
                self._reload()
                self._tell_manager()
                stop.wait(0.1)
        finally:
            self._manager.say(STOPPING)
            for role in reversed(self.roles):
                role.stop()

    def _reload(self) -> None:
        if not self.reloader.asked():
            return
        self._manager.reloading(time.monotonic())
        self.reloader.look()
        if self._ready:
            self._manager.say(READY)

    def _tell_manager(self) -> None:
        """That every port is open, once, and that the roles are watched."""
        if not self._ready and all(role.line and role.line.serves for role in self.roles if role.role in PORTS):
            self._ready = True
            self._manager.say(READY)
        self._manager.goes_on(time.monotonic())

    def _tell(self) -> None:
        write(self._runtime / ROLES_FILE, json.dumps({role.role: role.told() for role in self.roles}))
