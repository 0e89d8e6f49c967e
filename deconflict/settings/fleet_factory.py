"""Creates the fleet of a site."""

from typing import Any

from deconflict.settings.site import Site
from ingest.fleet.fast_path_types import FastPath
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures


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


def load_fast_path() -> FastPath[Any] | None:
    """The compiled fast path; None if `ingest/fast_path` is not installed.

    Loading takes half a second, and more if numba has to compile.
    """
    try:
        from ingest.fast_path.loader import load  # noqa: PLC0415 - loads numba
    except ModuleNotFoundError:
        return None
    return load()
