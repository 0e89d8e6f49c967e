"""The floor at a time in the past, read from the recording in a worker process, so that no live work waits."""

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TypeVar

from deconflict.operator.live.floor_frames import FloorFrames
from deconflict.runtime.worker_process import worker_pool
from deconflict.settings.fleet_factory import fleet_of, load_compiled_fast_path
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.fleet.recovery.kept_messages import kept_identities
from ingest.fleet.recovery.log_recovery import recover
from ingest.measures.measures import Measures
from ingest.recording.log_reader import begun_s, segments_until
from ingest.recording.log_segments import segments, under_present_name

MOST_WAITING = 4
"""Most requests at once; further ones are refused."""


Answer = TypeVar("Answer", str, bytes)


class BusyError(Exception):
    """The recording can't be read at present."""


def batch_at(site: Site, log: Path, at_s: float) -> bytes:
    """The whole floor at a time as a batch, from the recording alone."""
    fleet = fleet_of(site, Measures())
    if fast_path := load_compiled_fast_path():
        fleet.use(fast_path)
    recover(fleet, segments_until(log, at_s), at_s, kept=kept_identities(log))
    return fleet.snapshot(at_s).to_bytes()


def floor_at(site: Site, log: Path, at_s: float) -> str:
    """The whole floor at a time as one frame of `FloorFrames`, from the recording alone."""
    return whole_frame(Batch.from_bytes(batch_at(site, log, at_s)))


def whole_frame(batch: Batch) -> str:
    """A batch of the whole floor as one frame of `FloorFrames`."""
    frames = FloorFrames()
    frames.add_batch(batch, whole=True)
    return frames.since(0)


def recorded_span(log: Path, now_s: float) -> tuple[float, float] | None:
    """When the recording begins and ends, seconds since the epoch; None if there is none.

    What was recorded while the clock was ahead does not count until that time has come.
    """
    files = segments(log) if log.is_dir() else []
    if not files:
        return None
    until_s = min(under_present_name(files[-1], Path.stat).st_mtime, now_s)
    from_s = next((at_s for at_s in map(begun_s, files) if at_s <= until_s), None)
    return None if from_s is None else (from_s, until_s)


class History:
    """Reads the recording, one request at a time."""

    def __init__(self, site: Site, log: Path) -> None:
        self.site, self._log = site, log
        self._worker: ProcessPoolExecutor | None = None
        self._waiting = 0

    def recorded(self) -> tuple[float, float] | None:
        return recorded_span(self._log, time.time())

    async def read(self, read_at: Callable[[Site, Path, float], Answer], at_s: float) -> Answer:
        """What `floor_at` or `batch_at` reads of a time.

        Raises `BusyError` if too many requests wait, or the worker process ended.
        """
        if self._waiting >= MOST_WAITING:
            raise BusyError
        if self._worker is None:
            self._worker = worker_pool()
        self._waiting += 1
        try:
            return await asyncio.wrap_future(self._worker.submit(read_at, self.site, self._log, at_s))
        except BrokenProcessPool:
            self._worker = None
            raise BusyError from None
        finally:
            self._waiting -= 1

    def close(self) -> None:
        if self._worker:
            self._worker.shutdown(cancel_futures=True)
