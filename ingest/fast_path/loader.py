"""Loads the fast path. That brings numba, which takes half a second and 60 MB, and compiles what is not on disk yet."""

from ingest.fast_path.repeat_status import repeat_reader
from ingest.fast_path.status_scanner import ScannedStatus, scan
from ingest.fleet.fast_path_types import FastPath


def load() -> FastPath[ScannedStatus]:
    """The shortcuts for `Fleet.use`."""
    return FastPath(scan, repeat_reader)
