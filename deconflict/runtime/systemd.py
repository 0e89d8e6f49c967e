"""What the service manager is told, as sd_notify(3) of systemd says; where none listens, nobody is told."""

import logging
import os
import socket
from collections.abc import Mapping
from math import inf

log = logging.getLogger(__name__)

READY, STOPPING = "READY=1", "STOPPING=1"
SAID_WITHIN_S = 1.0


class Notifier:
    """Speaks to `NOTIFY_SOCKET`, and says that it goes on four times within `WATCHDOG_USEC`, as the manager asks."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        told = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + told[1:] if told.startswith("@") else told
        meant = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        watched_s = float(environment.get("WATCHDOG_USEC", 0)) / 1e6 if meant else 0.0
        self._every_s, self._due_s = watched_s / 4, -inf if watched_s else inf

    def say(self, *lines: str) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as said:
                said.settimeout(SAID_WITHIN_S)
                said.sendto("\n".join(lines).encode(), self._address)
        except OSError as error:
            log.warning("the service manager does not hear %s: %s", lines[0], error)

    def reloading(self, now_s: float) -> None:
        """To be followed by `READY`; `now_s` is of the clock that is never set."""
        self.say("RELOADING=1", f"MONOTONIC_USEC={round(now_s * 1e6)}")

    def goes_on(self, now_s: float) -> None:
        """Whoever calls this is not hung; said as often as is asked for."""
        if now_s >= self._due_s:
            self._due_s = now_s + self._every_s
            self.say("WATCHDOG=1")
