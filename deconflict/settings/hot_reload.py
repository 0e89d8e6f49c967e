"""Changes of the site file while the service runs: most are in use at once, some after a restart.

The supervisor reads the file on request, and writes the settings in use to a file that every role reads.
"""

import json
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from deconflict.settings.site import Site
from deconflict.settings.site_file import SiteError, site_from_document
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError

log = logging.getLogger(__name__)

SITE_FILE = "site.json"
"""The settings in use, in the runtime directory, for each role to read."""
RESULTS_FILE = "reloads.json"
"""How many reloads were `applied` and `refused`, the `problems` of the last, and the keys that need a restart."""
REQUEST_FILE = "reload.asked"
"""A role creates this file to request a reload."""
NEEDS_RESTART: dict[str, tuple[str, ...] | None] = {
    "receiver": ("host", "port", "tls", "max_message_bytes", "open_timeout_s"),
    "recorder": ("enabled",),
    "cluster": None,
    "operator": ("host", "port", "tls"),
    "store": ("directory",),
}
"""Keys that only a restart changes, by section; None for the whole section."""


def merged_settings(before: Site, changed: Site) -> tuple[Site, tuple[str, ...]]:
    """The settings from now on, and the changed keys that need a restart.

    Raises `SiteError` if the changes contradict settings that need a restart.
    """
    kept: dict[str, Any] = {}
    for section, keys in NEEDS_RESTART.items():
        old, new = getattr(before, section), getattr(changed, section)
        kept[section] = old if keys is None else new.model_copy(update={key: getattr(old, key) for key in keys})
    merged = changed.model_copy(update=kept)
    waiting = tuple(_differing(changed, merged))
    try:
        return site_from_document(merged.model_dump(mode="json", exclude_unset=True)), waiting
    except SiteError as error:
        raise SiteError([*error.problems, f"restart the service to change {', '.join(waiting)}"]) from error


def _differing(changed: Site, merged: Site) -> Iterator[str]:
    for section in NEEDS_RESTART:
        a, b = getattr(changed, section), getattr(merged, section)
        if a == b:
            continue
        if not hasattr(type(a), "model_fields") or type(a) is not type(b):
            yield section
            continue
        yield from (f"{section}.{key}" for key in type(a).model_fields if getattr(a, key) != getattr(b, key))


class Reloader:
    """Reads the site file again on request, and gives the current settings to the roles."""

    def __init__(self, site: Site, read: Callable[[], Site], runtime: Path) -> None:
        """`read` may raise `SiteError`, `SecretError` and `CertificateError`."""
        self._site, self._read, self._runtime = site, read, runtime
        self._requested = threading.Event()
        self._results: dict[str, Any] = {"applied": 0, "refused": 0, "problems": [], "needs_restart": []}
        write(runtime / SITE_FILE, site.model_dump_json())
        write(runtime / RESULTS_FILE, json.dumps(self._results))

    def request(self) -> None:
        """Request a reload. A signal handler may call this."""
        self._requested.set()

    def is_requested(self) -> bool:
        return self._requested.is_set() or (self._runtime / REQUEST_FILE).exists()

    def reload_if_requested(self) -> None:
        if not self.is_requested():
            return
        self._requested.clear()
        (self._runtime / REQUEST_FILE).unlink(missing_ok=True)
        try:
            site, waiting = merged_settings(self._site, self._read())
            write(self._runtime / SITE_FILE, site.model_dump_json())
        except Exception as error:  # noqa: BLE001 - whatever it is, the service goes on
            problems = _problems(error)
            self._write_result("refused", problems, self._results["needs_restart"])
            log.error("the changed site file is refused, the old settings stay in use: %s", "; ".join(problems))
            return
        self._site = site
        self._write_result("applied", [], list(waiting))
        log.info("the changed site file is in use")
        if waiting:
            log.warning("these keys of the site file need a restart: %s", ", ".join(waiting))

    def _write_result(self, result: str, problems: list[str], waiting: list[str]) -> None:
        self._results |= {result: self._results[result] + 1, "problems": problems, "needs_restart": waiting}
        try:
            write(self._runtime / RESULTS_FILE, json.dumps(self._results))
        except OSError as error:
            log.error("health can't see what became of the changed site file: %s", error)


def _problems(error: Exception) -> list[str]:
    """Why a site file is refused. A fault of the program ends no service that runs with the old file."""
    if isinstance(error, SiteError):
        return list(error.problems)
    if isinstance(error, SecretError | CertificateError):
        return [str(error)]
    if isinstance(error, OSError):
        return [f"the roles can't be told of it: {error}; free some space there, and reload again"]
    log.error("the site file can't be checked, which should be reported", exc_info=error)
    return [f"it can't be checked: {type(error).__name__}; see the log"]


class CurrentSite:
    """The current settings, as one role sees them."""

    def __init__(self, runtime: Path, site: Site) -> None:
        self._path, self._site = runtime / SITE_FILE, site
        self._modified_ns = 0

    def changed(self) -> Site | None:
        """The settings if they have changed since the last call; else None."""
        try:
            modified_ns = self._path.stat().st_mtime_ns
        except FileNotFoundError:
            return None
        if modified_ns == self._modified_ns:
            return None
        self._modified_ns = modified_ns
        site = Site.model_validate_json(self._path.read_text(encoding="utf-8"))
        if site == self._site:
            return None
        self._site = site
        return site


def write(path: Path, text: str) -> None:
    """Replace a file as a whole."""
    new = path.with_name(path.name + ".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


def reload_results(runtime: Path) -> dict[str, Any] | None:
    """The contents of `RESULTS_FILE`; None without a supervisor."""
    path = runtime / RESULTS_FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
