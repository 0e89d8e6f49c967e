"""Keeps the black boxes: notes near misses, waits for what follows, and has a worker process write each file."""

import asyncio
import json
import logging
import time
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import msgspec

from deconflict.operator.blackbox.archive import FOLDER, Archive, Box
from deconflict.operator.blackbox.blackbox_request import (
    WARM_UP_S,
    BlackBoxRequest,
    BoxSpan,
    KnownNearMiss,
    LearnedSnapshot,
    NearPair,
)
from deconflict.operator.store.pending_writes import DiskWork
from deconflict.operator.store.store import Store, StoreError
from deconflict.runtime.learned_state import unpacked
from deconflict.runtime.worker_process import WorkerError, run_in_process
from deconflict.settings.site import Site
from ingest.languages import timestamps
from ingest.measures.measures import Measures
from ingest.plain_files import check_file, read_file
from ingest.recording.clock_notes import ClockFile
from ingest.recording.log_reader import ends_s
from ingest.recording.replaced_file import replace_file, set_file_aside

log = logging.getLogger(__name__)

SHARED_FILE_S = 60.0
"""Near misses within this time of the first share its file."""
MOST_PAIRS = 50
"""Most near misses of one file. If there are more, the newest of the pair of vendors with the most is left out."""
SETTLE_S = 2.0
"""After this time the log and the store have everything that happened before."""
LATEST_S = 600.0
"""How much longer the keeper waits for a recording that is behind."""
CHECK_EVERY_S = 0.5
PRUNE_EVERY_S = 3600.0
SNAPSHOTS = 6
"""Number of snapshots of the learned state that are kept; one comes each minute."""
MOST_LOGGED = 3
"""Most near misses of one box that the service's log describes."""
LATEST_AT_S = 1e11
"""No near miss is later."""
BOXES_BEFORE = 3
"""A near miss of these boxes is not listed again."""
PENDING = "pending.json"
BLACKBOXES = "deconflict_blackboxes_total"


class Keeper:
    """The black boxes of one service. No method except `run` and `write_pending` waits."""

    def __init__(self, site: Site, data: Path, store: Store, measures: Measures) -> None:
        self.site, self._log, self._store, self._measures = site, data / "log", store, measures
        self.archive, self._clock = Archive(data / FOLDER), ClockFile(data)
        self._snapshots: deque[LearnedSnapshot] = deque(maxlen=SNAPSHOTS)
        self._under_way = b""
        """What the engine has under way at the next snapshot."""
        self._pending: list[tuple[float, NearPair]] = []
        """Each with the time at which it was noted, monotonic."""
        self._has_read_pending = False
        self.noting = DiskWork(self._write_noted)
        """Writes the pending pairs, once `run` has read those of before."""
        self._logged_behind = False
        """Whether the log says that the recording is behind."""
        for outcome in ("kept", "unfounded", "failed", "beyond"):
            measures.count(BLACKBOXES, outcome, by=0)

    def note(self, pairs: Iterable[NearPair]) -> None:
        """Note pairs that the engine has just seen within the clearance. `noting` keeps them for a restart."""
        for pair in pairs if self.site.keeps_boxes else ():
            pending = [*self._pending, (time.monotonic(), pair)]
            if len(pending) > MOST_PAIRS:
                pending.pop(_newest_of_largest_pair([noted for _, noted in pending]))
                self._measures.count(BLACKBOXES, "beyond")
            self._pending = pending

    def engine_started(self, learned: bytes) -> None:
        """An engine starts with the learned state of the one before; `learned` is empty if there is none."""
        self._snapshots.append(LearnedSnapshot(time.time(), learned, self._store.burdens_s(), is_start=True))

    def note_under_way(self, under_way: bytes) -> None:
        """What the engine has under way at the tick of the next snapshot."""
        self._under_way = under_way

    def add_snapshot(self, learned: bytes) -> None:
        """Take in the engine's learned state at a tick. Boxes start at such moments."""
        under_way, self._under_way = self._under_way, b""
        if tick := unpacked(learned).get("tick"):
            burdens_s = self._store.burdens_s()
            self._snapshots.append(LearnedSnapshot(float(tick["now_s"]), learned, burdens_s, under_way=under_way))

    async def run(self) -> None:
        """Write each box when it is due, until cancelled."""
        self.note(await asyncio.to_thread(self._read_pending))
        self._has_read_pending = True
        await self.noting.do()  # a pair that was noted meanwhile is not on disk
        pruned_s = float("-inf")
        while True:
            if time.monotonic() - pruned_s >= PRUNE_EVERY_S:
                pruned_s = time.monotonic()
                await asyncio.to_thread(self._prune)
            pairs = self._due(time.monotonic())
            recorded = await asyncio.to_thread(self._is_recorded, pairs) if pairs else False
            if recorded:
                await self._keep(pairs)
                self._pending = [pending for pending in self._pending if pending[1] not in pairs]
                await self.noting.do()
                await asyncio.to_thread(self._prune)
            await asyncio.sleep(CHECK_EVERY_S)

    def _due(self, now_s: float) -> list[NearPair]:
        """The pairs of the next box, once the time after them is over; else none."""
        if not self._pending:
            return []
        after_s = self.site.blackbox.after_s
        joined_s = self._pending[0][0] + min(SHARED_FILE_S, after_s)
        joined = [pending for pending in self._pending if pending[0] <= joined_s]
        return [pair for _, pair in joined] if now_s >= joined[-1][0] + after_s + SETTLE_S else []

    def _is_recorded(self, pairs: Sequence[NearPair]) -> bool:
        """Whether the log has all the time after the pairs, or the wait for it has lasted long enough."""
        after_s = self.site.blackbox.after_s
        if _ends_s(self._log) >= max(pair.at_s for pair in pairs) + after_s:
            self._logged_behind = False
            return True
        late_s = time.monotonic() - self._pending[len(pairs) - 1][0] - after_s - SETTLE_S
        if late_s > LATEST_S:
            log.error("the recording has not caught up in %g s; a black box is cut short", LATEST_S)
        elif not self._logged_behind:
            self._logged_behind = True
            log.warning("a black box waits for the recording, which is behind")
        return late_s > LATEST_S

    async def _keep(self, pairs: list[NearPair]) -> None:
        try:
            request = await asyncio.to_thread(self._request, pairs)
            box = await run_in_process(_write, request)
        except (OSError, StoreError, WorkerError) as error:
            self._measures.count(BLACKBOXES, "failed")
            log.error("a near miss at %s has no black box: %s", timestamps.write(pairs[0].at_s), error)
            return
        self._measures.count(BLACKBOXES, "kept" if box else "unfounded")
        if box:
            summaries = [near_miss["summary"] for near_miss in box["near_misses"]]
            more = [f"And {len(summaries) - MOST_LOGGED} more."] if len(summaries) > MOST_LOGGED else []
            text = " ".join([*summaries[:MOST_LOGGED], *more])
            log.warning("near miss: %s (%s, sha256 %s)", text, box["file"], box["sha256"])

    def _request(self, pairs: list[NearPair]) -> BlackBoxRequest:
        settings = self.site.blackbox
        begins_s = min(pair.at_s for pair in pairs) - settings.before_s - WARM_UP_S
        oldest = next(iter(self._snapshots), None)
        snapshot = next((snapshot for snapshot in reversed(self._snapshots) if snapshot.at_s <= begins_s), oldest)
        span = BoxSpan.around(pairs, settings.before_s, settings.after_s, snapshot)
        self.archive.directory.mkdir(parents=True, exist_ok=True)
        return BlackBoxRequest(
            self.site,
            self._log,
            self.archive.directory,
            tuple(pairs),
            span,
            snapshot,
            self._store.path,
            tuple(advisory.model_dump_json() for advisory in self._store.pending_until(span.until_s)),
            known_of(self.archive.boxes()[-BOXES_BEFORE:]),
        )

    def _prune(self) -> None:
        settings = self.site.blackbox
        known = self._clock.known_time()
        before, latest = map(timestamps.write, (known.before_s(settings.keep_days), known.latest_s))
        try:
            removed = self.archive.prune(
                files=settings.files, total_bytes=settings.total_bytes, before=before, latest=latest
            )
        except OSError as error:
            log.warning("old black boxes can't be removed: %s", error)
        else:
            if removed:
                log.info("removed black boxes: %s", ", ".join(removed))

    def _write_noted(self) -> None:
        if self._has_read_pending:  # else those of before would be replaced
            self.write_pending()

    def write_pending(self) -> None:
        """Write the pending pairs to disk. If that fails, only a restart loses them."""
        path = self.archive.directory / PENDING
        try:
            if self._pending:
                path.parent.mkdir(parents=True, exist_ok=True)
                replace_file(path, json.dumps([pair for _, pair in self._pending]).encode())
            else:
                check_file(path)
                path.unlink(missing_ok=True)
        except OSError as error:
            log.warning("%s can't be written: %s", path, error)

    def _read_pending(self) -> list[NearPair]:
        """The pairs that were pending when the service ended, to resume with."""
        path = self.archive.directory / PENDING
        try:
            pairs = _PAIRS.decode(read_file(path)) if path.exists() else []
            if not all(0.0 <= pair.at_s <= LATEST_AT_S for pair in pairs):
                raise ValueError("a time in it is no time")
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            with suppress(OSError):
                path = set_file_aside(path)
            log.warning("near misses that waited for their black box can't be read and are kept as %s: %s", path, error)
        except OSError as error:
            log.warning("%s can't be read: %s", path, error)
        else:
            return pairs
        return []


def known_of(boxes: Iterable[Box]) -> tuple[KnownNearMiss, ...]:
    """The near misses that some boxes have."""
    near_misses = (near_miss for box in boxes for near_miss in box["near_misses"])
    return tuple(
        KnownNearMiss((each["robots"][0], each["robots"][1]), datetime.fromisoformat(each["nearest_at"]).timestamp())
        for each in near_misses
    )


def _ends_s(log_folder: Path) -> float:
    """As of `ends_s`; 0 while the recording can't be read."""
    try:
        return ends_s(log_folder)
    except OSError:
        return 0.0


_PAIRS = msgspec.json.Decoder(list[NearPair])


def _newest_of_largest_pair(pairs: Sequence[NearPair]) -> int:
    """Index of the newest near miss of the pair of vendors with the most near misses."""
    counts = Counter(pair.vendors for pair in pairs)
    most = max(counts.values())
    return max(row for row, pair in enumerate(pairs) if counts[pair.vendors] == most)


def _write(request: BlackBoxRequest) -> Box | None:
    from deconflict.operator.blackbox.blackbox_writer import write_blackbox  # noqa: PLC0415 - loads numba

    return write_blackbox(request)
