"""Creates the fleet of a site."""

import logging
from typing import TYPE_CHECKING

from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures

if TYPE_CHECKING:  # loads numba
    from ingest.fleet.repeat_status import FastPath

log = logging.getLogger(__name__)


class _NotCompiledError(Exception):
    """A kernel is not on disk."""


def fleet_of(site: Site, measures: Measures) -> Fleet:
    """An empty fleet with the site's settings."""
    frames = FrameRegistry(site.datums, site.vendors)
    return Fleet(VendorRegistry(site.vendors), frames, site.reading, measures, Quarantine())


def fast_fleet_of(site: Site, measures: Measures) -> Fleet:
    """The same with the fast path, if it is installed."""
    fleet = fleet_of(site, measures)
    if fast_path := load_fast_path():
        fleet.use(fast_path)
    return fleet


def load_fast_path() -> "FastPath | None":
    """The compiled fast path; None if `ingest/fast_path` is not installed.

    Loading takes half a second, and more if numba has to compile.
    """
    try:
        from ingest.fleet.repeat_status import load  # noqa: PLC0415 - loads numba
    except ModuleNotFoundError:
        return None
    return load()


def load_compiled_fast_path() -> "FastPath | None":
    """The fast path if it is on disk and can be read; else None. In a process that has loaded numba it takes 0.1 s."""
    from ingest.kernels import before_compiling  # noqa: PLC0415 - loads numba

    try:
        with before_compiling(_refuse):
            return load_fast_path()
    except _NotCompiledError:
        return None
    except Exception:
        log.exception("the fast path can't be loaded, which should be reported; messages are read without it")
        return None


def _refuse() -> None:
    raise _NotCompiledError
