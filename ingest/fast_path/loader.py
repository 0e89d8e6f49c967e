"""Loads the fast path. This imports numba, which takes 0.5 s and 60 MB, and compiles kernels that are not on disk."""

from ingest.fast_path.repeat_status import repeat_reader
from ingest.fast_path.status_scanner import ScannedStatus, scan
from ingest.fleet.fast_path_types import FastPath


def load() -> FastPath[ScannedStatus]:
    """The functions for `Fleet.use`."""
    return FastPath(scan, repeat_reader)
