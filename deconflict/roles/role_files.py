"""What roles know of each other by files in the runtime directory: the processes, and how far the engine is."""

import json
import logging
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from deconflict.cluster.members_health import health_part
from deconflict.settings.hot_reload import write

ROLES_FILE = "roles.json"
"""What the supervisor writes about its processes: `RoleProcess.document` by role."""
SUPERVISOR_SILENCE_S = 5.0
"""A supervisor that has not touched `ROLES_FILE` for this long is reported; it does so each second."""
REPORT_STALE_S = 5.0
"""A role that has not reported for this long counts as down; it reports every second."""
EARLY_S = 60.0
"""A process that fails before may fail because of what it started with."""
PREPARATION_FILE = "preparation.json"
"""While the engine compiles its kernels: how many are `done` of the `total`."""
ALONE_FILE = "alone"
"""Is there while the operator face of a cluster's machine takes decisions from the engine of this machine alone."""

log = logging.getLogger(__name__)


class PreparationProgress:
    """Shows the progress in a file for the operator face, and in the log."""

    def __init__(self, runtime: Path, beat: Callable[[], object] = lambda: None) -> None:
        """`beat` is called at each report, since the engine is silent meanwhile."""
        self._path, self._beat, self._began_s = runtime / PREPARATION_FILE, beat, time.monotonic()

    def report(self, done: int, total: int) -> None:
        self._beat()
        if done == 0:
            log.info("the engine compiles %s kernels, once on this machine; advisories begin afterwards", total)
        with suppress(OSError):  # a full disk must not end what compiles; the log says when it begins and ends
            write(self._path, json.dumps({"done": done, "total": total}))

    def end(self) -> None:
        """The engine is loaded, whether it had to compile or not."""
        if self._path.exists():
            self._path.unlink()
            log.info("the kernels are compiled after %.0f s", time.monotonic() - self._began_s)


def preparation(runtime: Path) -> dict[str, Any] | None:
    """The contents of `PREPARATION_FILE`; None if the engine does not compile."""
    try:
        document: dict[str, Any] = json.loads((runtime / PREPARATION_FILE).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    return document


RoleProcesses = Mapping[str, Mapping[str, Any]]
"""By role, the contents of `ROLES_FILE`."""


def role_processes(runtime: Path) -> RoleProcesses:
    """The contents of `ROLES_FILE`; empty without a supervisor."""
    path = runtime / ROLES_FILE
    return json.loads(path.read_text()) if path.exists() else {}


def is_up(processes: RoleProcesses, role: str, reported_s: float, now_s: float) -> bool:
    """Whether a role that last reported at `reported_s` is up: recently, by the process that runs now.

    Times are of the monotonic clock. Without a supervisor the process of a report is the one that runs.
    """
    since_s = processes[role]["since_s"] if role in processes else float("-inf")
    return since_s is not None and reported_s >= since_s and now_s - reported_s < REPORT_STALE_S


def supervisor_health(runtime: Path) -> dict[str, Any]:
    """Whether the supervisor runs, by how long ago it touched its file. Ok where there is none."""
    try:
        age_s = time.time() - (runtime / ROLES_FILE).stat().st_mtime
    except FileNotFoundError:
        return health_part([])
    reason = f"the supervisor has been silent for {age_s:.0f} s; it restarts no role and reads no changed site file"
    return health_part([reason] if abs(age_s) > SUPERVISOR_SILENCE_S else [])


def early_end(runtime: Path, role: str) -> str:
    """How the process of a role ended before this one, if it crashed or hung in its first minute; else empty."""
    after_s = role_processes(runtime).get(role, {}).get("failed_after_s")
    return "" if after_s is None or after_s >= EARLY_S else f"crashed or hung after {after_s:.0f} s"


def restarts(processes: RoleProcesses) -> dict[str, int]:
    """By role, of what `role_processes` returned."""
    return {role: process["restarts"] for role, process in processes.items()}


def stands_alone(runtime: Path) -> bool:
    """Whether the operator face is to take decisions from the engine of this machine alone."""
    return (runtime / ALONE_FILE).exists()
