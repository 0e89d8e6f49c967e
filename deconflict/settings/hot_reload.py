"""A changed site file that is taken up while the service runs: what holds at once, and what waits for a restart.

The supervisor reads the file when it is asked to and writes the settings in force where every role looks for them.
"""

import json
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from deconflict.settings.site import Site, SiteError, from_told
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError

log = logging.getLogger(__name__)

SITE_FILE = "site.json"
"""The settings in force, in the runtime directory, for each role to read."""
RELOADS_FILE = "reloads.json"
"""How many reloads were `applied` and `refused`, the newest one's `problems`, and the keys that wait for a restart."""
ASKED_FILE = "reload.asked"
"""A role that wants a reload puts this there."""
FIXED: dict[str, tuple[str, ...] | None] = {
    "receiver": ("host", "port", "tls", "max_message_bytes", "open_timeout_s"),
    "recorder": ("enabled",),
    "cluster": None,
    "operator": ("host", "port", "tls"),
    "store": ("directory",),
}
"""Sections that a restart alone changes, as a whole or the keys named."""


def in_force(before: Site, told: Site) -> tuple[Site, tuple[str, ...]]:
    """The settings that hold from now on, and the changed keys that wait for a restart.

    Raises `SiteError` where what changes does not go with what can't.
    """
    kept: dict[str, Any] = {}
    for section, keys in FIXED.items():
        old, new = getattr(before, section), getattr(told, section)
        kept[section] = old if keys is None else new.model_copy(update={key: getattr(old, key) for key in keys})
    merged = told.model_copy(update=kept)
    waiting = tuple(_differing(told, merged))
    try:
        return from_told(merged.model_dump(mode="json")), waiting
    except SiteError as error:
        raise SiteError([*error.problems, f"restart the service to change {', '.join(waiting)}"]) from error


def _differing(told: Site, merged: Site) -> Iterator[str]:
    for section in FIXED:
        a, b = getattr(told, section), getattr(merged, section)
        if a == b:
            continue
        if not hasattr(type(a), "model_fields") or type(a) is not type(b):
            yield section
            continue
        yield from (f"{section}.{key}" for key in type(a).model_fields if getattr(a, key) != getattr(b, key))


class Reloader:
    """Reads the site file again when asked, and hands the settings in force to the roles."""

    def __init__(self, site: Site, read: Callable[[], Site], runtime: Path) -> None:
        """`read` may raise `SiteError`, `SecretError` and `CertificateError`."""
        self._site, self._read, self._runtime = site, read, runtime
        self._asked = threading.Event()
        self._told: dict[str, Any] = {"applied": 0, "refused": 0, "problems": [], "needs_restart": []}
        write(runtime / SITE_FILE, site.model_dump_json())
        write(runtime / RELOADS_FILE, json.dumps(self._told))

    def ask(self) -> None:
        """Have it done at the next `look`; a signal may call this."""
        self._asked.set()

    def asked(self) -> bool:
        return self._asked.is_set() or (self._runtime / ASKED_FILE).exists()

    def look(self) -> None:
        """Carry out what was asked since the last look."""
        if not self.asked():
            return
        self._asked.clear()
        (self._runtime / ASKED_FILE).unlink(missing_ok=True)
        try:
            site, waiting = in_force(self._site, self._read())
        except (SiteError, SecretError, CertificateError) as error:
            problems = list(error.problems) if isinstance(error, SiteError) else [str(error)]
            self._tell("refused", problems, self._told["needs_restart"])
            log.error("the changed site file is not taken up, the old settings hold: %s", "; ".join(problems))
            return
        self._site = site
        write(self._runtime / SITE_FILE, site.model_dump_json())
        self._tell("applied", [], list(waiting))
        log.info("the changed site file is in force")
        if waiting:
            log.warning("these keys of the site file wait for a restart: %s", ", ".join(waiting))

    def _tell(self, result: str, problems: list[str], waiting: list[str]) -> None:
        self._told |= {result: self._told[result] + 1, "problems": problems, "needs_restart": waiting}
        write(self._runtime / RELOADS_FILE, json.dumps(self._told))


class InForce:
    """The settings in force as a role holds them."""

    def __init__(self, runtime: Path, site: Site) -> None:
        self._path, self._site = runtime / SITE_FILE, site
        self._written = 0

    def changed(self) -> Site | None:
        """The settings, where they have changed since this was asked last."""
        try:
            written = self._path.stat().st_mtime_ns
        except FileNotFoundError:
            return None
        if written == self._written:
            return None
        self._written = written
        told = Site.model_validate_json(self._path.read_text(encoding="utf-8"))
        if told == self._site:
            return None
        self._site = told
        return told


def write(path: Path, text: str) -> None:
    """Put a file in place as a whole."""
    new = path.with_name(path.name + ".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


def reloads(runtime: Path) -> dict[str, Any] | None:
    """What the supervisor says of reloads; None where there is no supervisor."""
    path = runtime / RELOADS_FILE
    told: dict[str, Any] | None = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
    return told
