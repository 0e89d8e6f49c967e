"""Keeps a process for each role running: restarts a process that ends, and kills one that hangs."""

import json
import logging
import sys
import threading
import time
from collections.abc import Callable, Iterable
from functools import partial
from itertools import chain
from pathlib import Path

from deconflict.roles.processes.forked_process import forked
from deconflict.roles.processes.role_process import RoleProcess, by_command
from deconflict.roles.role_files import ROLES_FILE
from deconflict.runtime.systemd import READY, STOPPING, Notifier
from deconflict.settings.hot_reload import Reloader, write
from deconflict.settings.site import Site
from ingest.recording.clock_notes import ClockFile

log = logging.getLogger(__name__)

PARTS = {"face": ("operator",), "ingest": ("receiver",), "engine": ("engine",)}
"""The parts of the service and their roles, in the order in which they start."""
CLUSTER_PARTS = {"face": ("operator", "follower"), "ingest": ("receiver", "feed"), "engine": ("engine",)}
"""The same in a cluster, where each machine runs the parts that its command names."""
PORTS = {"receiver": "robots connect to ws%s://%s:%s/", "operator": "the page is at http%s://%s:%s/"}
"""The roles that have a network port, and how the log tells people of it."""
DISK_TIMEOUT_S = 1.0
"""How long its end waits for the disk."""
WRITE_EVERY_S = 1.0
"""How often it writes about its roles, so that health can see that it runs."""


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
        roles = [*chain.from_iterable((CLUSTER_PARTS if site.cluster else PARTS)[part] for part in parts)]
        self._runtime, self._written_s, self._clock = runtime, float("-inf"), ClockFile(data)
        self.reloader = Reloader(site, read or (lambda: site), runtime)
        server = [sys.executable, "-P", "-m", "deconflict.roles", str(runtime), str(data), *roles]
        self.fork_server = RoleProcess("fork server", by_command(server))
        self.roles = [RoleProcess(role, partial(forked, runtime, role)) for role in roles]

    def run(self, stop: threading.Event) -> None:
        """Keep the roles running until `stop` is set, then end them."""
        ended = threading.Event()
        noting = threading.Thread(target=self._clock.keep, args=(ended,), name="clock", daemon=True)
        noting.start()
        try:
            while not stop.is_set():
                self.fork_server.ensure(time.monotonic())
                if [role for role in self.roles if role.note_end(time.monotonic())]:
                    self._write_roles()  # a process that starts reads how the one before ended
                changed = [role.role for role in self.roles if role.ensure(time.monotonic())]
                if changed or time.monotonic() - self._written_s >= WRITE_EVERY_S:
                    self._write_roles()
                self._reload()
                self._notify_manager()
                stop.wait(0.1)
        finally:
            ended.set()
            self._manager.send(STOPPING)
            for process in (self.fork_server, *reversed(self.roles)):  # it forks no role that nobody waits for
                process.stop()
            noting.join(DISK_TIMEOUT_S)

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
        try:
            write(self._runtime / ROLES_FILE, json.dumps({role.role: role.document() for role in self.roles}))
        except OSError as error:
            log.error("health can't see the roles: %s; free some space in %s", error, self._runtime)
