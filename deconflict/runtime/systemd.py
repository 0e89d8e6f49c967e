"""Messages to the service manager, by the sd_notify(3) protocol of systemd. Without a manager nothing is sent."""

import logging
import os
import socket
from collections.abc import Mapping
from math import inf

log = logging.getLogger(__name__)

READY, STOPPING = "READY=1", "STOPPING=1"
SEND_TIMEOUT_S = 1.0


class Notifier:
    """Sends to `NOTIFY_SOCKET`. Sends four watchdog messages in each interval of `WATCHDOG_USEC`."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        path = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + path[1:] if path.startswith("@") else path
        is_for_us = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        interval_s = _watchdog_s(environment.get("WATCHDOG_USEC", "0")) if is_for_us else 0.0
        self._every_s, self._due_s = interval_s / 4, -inf if interval_s else inf

    def send(self, *lines: str) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as datagrams:
                datagrams.settimeout(SEND_TIMEOUT_S)
                datagrams.sendto("\n".join(lines).encode(), self._address)
        except OSError as error:
            log.warning("the service manager does not receive %s: %s", lines[0], error)

    def send_reloading(self, now_s: float) -> None:
        """Call `send(READY)` when the reload is done. `now_s` is monotonic time."""
        self.send("RELOADING=1", f"MONOTONIC_USEC={round(now_s * 1e6)}")

    def send_watchdog(self, now_s: float) -> None:
        """Report that the caller is alive, if a watchdog message is due. `now_s` is monotonic time."""
        if now_s >= self._due_s:
            self._due_s = now_s + self._every_s
            self.send("WATCHDOG=1")


def _watchdog_s(text: str) -> float:
    """The interval of `WATCHDOG_USEC`; 0 if it is none: then no watchdog message is sent."""
    if text.isascii() and text.isdecimal():
        return float(text) / 1e6
    log.warning("WATCHDOG_USEC is no number of microseconds, so the service manager is sent no watchdog messages")
    return 0.0
