"""Keeps a process for each role running: restarts a process that ends, and kills one that hangs."""

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

from deconflict.roles.role_files import ROLES_FILE
from deconflict.runtime.heartbeat import HeartbeatMonitor
from deconflict.runtime.systemd import READY, STOPPING, Notifier
from deconflict.settings.hot_reload import Reloader, write
from deconflict.settings.site import Site

log = logging.getLogger(__name__)

PARTS = {"face": ("operator",), "ingest": ("receiver",), "engine": ("engine",)}
"""The parts of the service and their roles, in the order in which they start."""
CLUSTER_PARTS = {"face": ("operator", "follower"), "ingest": ("receiver", "feed"), "engine": ("engine",)}
"""The same in a cluster, where each machine runs the parts that its command names."""
PORTS = {"receiver": "robots connect to ws%s://%s:%s/", "operator": "the page is at http%s://%s:%s/"}
"""The roles that have a network port, and how the log tells people of it."""
STOP_TIMEOUT_S = 10.0
BACKOFF_S = (0.2, 10.0)
"""First and longest wait before a role that ends repeatedly is restarted. The first restart is at once."""
WRITE_EVERY_S = 1.0
"""How often it writes about its roles, so that health can see that it runs."""
STEADY_S = 10.0
"""A role that ran for this long does not end repeatedly."""
MEMORY = {"MALLOC_ARENA_MAX": "2"}
"""Default environment of the roles. glibc gives threads heaps of their own, up to eight for each core, and each heap
keeps its largest size. With this setting all threads share one heap."""


@dataclass(slots=True, eq=False)
class RoleProcess:
    """One role's process. It ends when its heartbeat connection closes, so it never outlives its supervisor."""

    role: str
    command: list[str]
    process: subprocess.Popen[bytes] | None = None
    """None while it does not run."""
    heartbeats: HeartbeatMonitor | None = None
    """Of the running process, or of the last one."""
    restarts: int = 0
    started_s: float = field(default=float("-inf"))
    """When the process was last started. Times are of the monotonic clock."""
    backoff_s: float = 0.0
    """How long the next restart waits."""
    due_s: float = float("-inf")
    """No start before this time."""

    def ensure(self, now_s: float) -> bool:
        """Start the process if it does not run and is due; kill it if it hangs. Returns whether it ended or started."""
        if self.process and self.heartbeats and self.process.poll() is None:
            if self.heartbeats.hangs(now_s):
                log.error("the %s hangs and is killed", self.role)
                self.process.kill()
            return False
        ended = self.process is not None
        if self.process:
            self._note_end(now_s, self.process)
        if now_s < self.due_s:
            return ended
        self.heartbeats = HeartbeatMonitor(now_s)
        self.process = subprocess.Popen(  # noqa: S603
            self.command, stdin=self.heartbeats.theirs.fileno(), start_new_session=True, env=MEMORY | os.environ
        )
        self.heartbeats.theirs.close()
        self.started_s = now_s
        return True

    def _note_end(self, now_s: float, process: subprocess.Popen[bytes]) -> None:
        if now_s - self.started_s > STEADY_S:
            self.backoff_s = 0.0
        log.warning(
            "the %s ended with code %s and is restarted in %.1f s", self.role, process.returncode, self.backoff_s
        )
        self.due_s = now_s + self.backoff_s
        self.backoff_s = min(max(2 * self.backoff_s, BACKOFF_S[0]), BACKOFF_S[1])
        self.restarts += 1
        if self.heartbeats:
            self.heartbeats.close()
        self.process = None

    def document(self) -> dict[str, float | None]:
        """The number of restarts, and since when the process runs; None if it does not run."""
        return {"restarts": self.restarts, "since_s": self.started_s if self.process else None}

    def stop(self) -> None:
        if self.process is None:
            return
        if self.heartbeats:
            self.heartbeats.close()
        try:
            self.process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            log.warning("the %s did not stop in %s s and is killed", self.role, STOP_TIMEOUT_S)
            self.process.kill()
            self.process.wait()


class Supervisor:
    """Runs the roles of some parts of the service."""

    def __init__(
        self,
        site: Site,
        data: Path,
        runtime: Path,
        read: Callable[[], Site] | None = None,
        parts: Iterable[str] = PARTS,
        manager: Notifier | None = None,
    ) -> None:
        """`read` reads the site file again for `Reloader`; None if there is no site file."""
        self._site, self._manager, self._ready = site, manager or Notifier({}), False
        roles = chain.from_iterable((CLUSTER_PARTS if site.cluster else PARTS)[part] for part in parts)
        self._runtime, self._written_s = runtime, float("-inf")
        self.reloader = Reloader(site, read or (lambda: site), runtime)
        self.roles = [
            RoleProcess(role, [sys.executable, "-m", "deconflict.roles", role, str(runtime), str(data)])
            for role in roles
        ]

    def run(self, stop: threading.Event) -> None:
        """Keep the roles running until `stop` is set, then end them."""
        try:
            while not stop.is_set():
                changed = [role.role for role in self.roles if role.ensure(time.monotonic())]
                if changed or time.monotonic() - self._written_s >= WRITE_EVERY_S:
                    self._write_roles()
                self._reload()
                self._notify_manager()
                stop.wait(0.1)
        finally:
            self._manager.send(STOPPING)
            for role in reversed(self.roles):
                role.stop()

    def _reload(self) -> None:
        if not self.reloader.is_requested():
            return
        self._manager.send_reloading(time.monotonic())
        self.reloader.reload_if_requested()
        if self._ready:
            self._manager.send(READY)

    def _notify_manager(self) -> None:
        """Send `READY` once every port is open, and the watchdog messages."""
        if not self._ready and all(
            role.heartbeats and role.heartbeats.port_is_open for role in self.roles if role.role in PORTS
        ):
            self._ready = True
            self._manager.send(READY)
            self._log_addresses()
        self._manager.send_watchdog(time.monotonic())

    def _log_addresses(self) -> None:
        roles = {role.role for role in self.roles}
        for name in PORTS.keys() & roles:
            section = getattr(self._site, name)
            host = f"[{section.host}]" if ":" in section.host else section.host
            log.info(PORTS[name], "s" if section.tls else "", host, section.port)

    def _write_roles(self) -> None:
        self._written_s = time.monotonic()
        write(self._runtime / ROLES_FILE, json.dumps({role.role: role.document() for role in self.roles}))
