"""The floor as it was, read from the recording by a process of its own, so that the live picture never waits for it."""

import asyncio
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from deconflict.operator.live.floor_frames import Picture
from deconflict.runtime.worker_process import worker
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.recovery import recover
from ingest.measures.measures import Measures
from ingest.recording.log_reader import begun_s, segments, segments_until

MOST_WAITING = 4
"""Readings of the past asked for at once; more are refused."""


class BusyError(Exception):
    """The past can't be read just now."""


def floor_at(site: Site, log: Path, at_s: float) -> str:
    """The whole floor at a time as one frame of `Picture`, from the recording alone."""
    fleet, picture = fleet_of(site, Measures()), Picture()
    recover(fleet, segments_until(log, at_s), at_s)
    picture.put(fleet.snapshot(at_s), whole=True)
    return picture.since(0)


def recorded(log: Path) -> tuple[float, float] | None:
    """When what is recorded begins and ends, seconds since the epoch; None where nothing is."""
    files = segments(log) if log.is_dir() else []
    return (begun_s(files[0]), min(files[-1].stat().st_mtime, time.time())) if files else None


class Past:
    """Reads the past, one reading at a time."""

    def __init__(self, site: Site, log: Path) -> None:
        self.site, self._log = site, log
        self._worker: ProcessPoolExecutor | None = None
        self._waiting = 0

    def recorded(self) -> tuple[float, float] | None:
        return recorded(self._log)

    async def floor_at(self, at_s: float) -> str:
        """Raises `BusyError` where enough others wait, or the reading broke off."""
        if self._waiting >= MOST_WAITING:
            raise BusyError
        if self._worker is None:
            self._worker = worker()
        self._waiting += 1
        try:
            return await asyncio.wrap_future(self._worker.submit(floor_at, self.site, self._log, at_s))
        except BrokenProcessPool:
            self._worker = None
            raise BusyError from None
        finally:
            self._waiting -= 1

    def close(self) -> None:
        if self._worker:
            self._worker.shutdown(cancel_futures=True)
