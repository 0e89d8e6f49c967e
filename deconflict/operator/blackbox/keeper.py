"""Keeps the black boxes: notes near misses, waits for what comes after, and has the file cut by a process aside."""

import asyncio
import json
import logging
import time
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from deconflict.operator.blackbox.archive import FOLDER, Box, Shelf
from deconflict.operator.blackbox.blackbox_request import WARM_S, Near, Order, Snapshot, Span
from deconflict.operator.store.store import Store, StoreError
from deconflict.runtime.learned_state import unpacked
from deconflict.runtime.worker_process import AsideError, once
from deconflict.settings.site import Site
from ingest.languages.massrobotics import timestamps
from ingest.measures.measures import Measures
from ingest.recording.log_reader import ends_s

log = logging.getLogger(__name__)

JOINED_S = 60.0
"""Near misses within this time of the first share its file."""
MOST_PAIRS = 50
"""So many of them, of the vendors that have the most the earliest; what else happened is in the file without a word."""
SETTLE_S = 2.0
"""Until then the log and the store have what happened before."""
LATEST_S = 600.0
"""How much longer a recording that is behind is waited for."""
LOOK_EVERY_S = 0.5
PRUNE_EVERY_S = 3600.0
SNAPSHOTS = 6
"""Of the engine's learning that are remembered; one a minute."""
TOLD = 3
"""Near misses of one box that the service's log tells in words."""
PENDING = "pending.json"
COUNTED = "deconflict_blackboxes_total"


class Keeper:
    """Of one service. Everything but `run` is quick."""

    def __init__(self, site: Site, data: Path, store: Store, measures: Measures) -> None:
        self.site, self._log, self._store, self._measures = site, data / "log", store, measures
        self.shelf = Shelf(data / FOLDER)
        self._snapshots: deque[Snapshot] = deque(maxlen=SNAPSHOTS)
        self._pending: list[tuple[float, Near]] = []
        """With when each was noted, by the monotonic clock, which nobody sets."""
        self._waits = False
        """Whether it was told that the recording is behind."""
        for outcome in ("kept", "unfounded", "failed", "beyond"):
            measures.count(COUNTED, outcome, by=0)

    def note(self, near: Iterable[Near]) -> None:
        """Near misses that the engine has just noticed. Writes them down, so that a restart forgets none."""
        wanted = self.site.blackbox.enabled and self.site.recorder.enabled
        for one in near if wanted else ():
            pending = [*self._pending, (time.monotonic(), one)]
            if len(pending) > MOST_PAIRS:
                pending.pop(_least_missed([noted for _, noted in pending]))
                self._measures.count(COUNTED, "beyond")
            self._pending = pending
        self._remember()

    def begun(self, learned: bytes) -> None:
        """An engine begins with what one before it had learned, nothing where there is none."""
        self._snapshots.append(Snapshot(time.time(), learned, self._store.burdens_s()))

    def learned(self, learned: bytes) -> None:
        """What the engine had learned by a tick; boxes begin at such moments."""
        tick = unpacked(learned).get("tick")
        if tick:
            self._snapshots.append(Snapshot(float(tick["now_s"]), learned, self._store.burdens_s()))

    async def run(self) -> None:
        """Cut what is due, until cancelled."""
        await asyncio.to_thread(self._recall)
        pruned_s = float("-inf")
        while True:
            if time.monotonic() - pruned_s >= PRUNE_EVERY_S:
                pruned_s = time.monotonic()
                await asyncio.to_thread(self._prune)
            near = self._due(time.monotonic())
            recorded = await asyncio.to_thread(self._is_recorded, near) if near else False
            if recorded:
                await self._keep(near)
                self._pending = [pending for pending in self._pending if pending[1] not in near]
                await asyncio.to_thread(self._remember)
                await asyncio.to_thread(self._prune)
            await asyncio.sleep(LOOK_EVERY_S)

    def _due(self, now_s: float) -> list[Near]:
        """Those of the next box, once all that comes after them is recorded."""
        if not self._pending:
            return []
        after_s = self.site.blackbox.after_s
        joined_s = self._pending[0][0] + min(JOINED_S, after_s)
        joined = [pending for pending in self._pending if pending[0] <= joined_s]
        return [near for _, near in joined] if now_s >= joined[-1][0] + after_s + SETTLE_S else []

    def _is_recorded(self, near: Sequence[Near]) -> bool:
        """Whether the log tells of all the time after them, or that has been waited for long enough."""
        after_s = self.site.blackbox.after_s
        if ends_s(self._log) >= max(one.at_s for one in near) + after_s:
            self._waits = False
            return True
        late_s = time.monotonic() - self._pending[len(near) - 1][0] - after_s - SETTLE_S
        if late_s > LATEST_S:
            log.error("the recording has not caught up in %g s; a black box is cut short", LATEST_S)
        elif not self._waits:
            self._waits = True
            log.warning("a black box waits for the recording, which is behind")
        return late_s > LATEST_S

    async def _keep(self, near: list[Near]) -> None:
        try:
            box = await self._cut(near)
        except (OSError, StoreError, AsideError) as error:
            self._measures.count(COUNTED, "failed")
            log.error("a near miss at %s has no black box: %s", timestamps.write(near[0].at_s), error)
            return
        self._measures.count(COUNTED, "kept" if box else "unfounded")
        if box:
            every = [one["summary"] for one in box["near_misses"]]
            told = "; ".join(every[:TOLD]) + (f"; and {len(every) - TOLD} more" if len(every) > TOLD else "")
            log.warning("near miss: %s (%s, sha256 %s)", told, box["file"], box["sha256"])

    async def _cut(self, near: list[Near]) -> Box | None:
        order = await asyncio.to_thread(self._order, near)
        return await once(_cut, order)

    def _order(self, near: list[Near]) -> Order:
        settings = self.site.blackbox
        begins_s = min(one.at_s for one in near) - settings.before_s - WARM_S
        snapshot = next((one for one in reversed(self._snapshots) if one.at_s <= begins_s), None)
        span = Span.around(near, settings.before_s, settings.after_s, snapshot)
        self.shelf.directory.mkdir(parents=True, exist_ok=True)
        return Order(
            self.site,
            self._log,
            self.shelf.directory,
            tuple(near),
            span,
            snapshot,
            self._store.path,
            tuple(one.model_dump_json() for one in self._store.waiting(span.until_s)),
        )

    def _prune(self) -> None:
        settings = self.site.blackbox
        before = datetime.now(UTC) - timedelta(days=settings.keep_days)
        try:
            gone = self.shelf.prune(
                files=settings.files, total_bytes=settings.total_bytes, before=timestamps.write(before.timestamp())
            )
        except OSError as error:
            log.warning("old black boxes can't be removed: %s", error)
        else:
            if gone:
                log.info("removed black boxes: %s", ", ".join(gone))

    def _remember(self) -> None:
        """Put what is pending on the disk; where that fails only a restart would lose it."""
        path = self.shelf.directory / PENDING
        try:
            if self._pending:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(json.dumps([near for _, near in self._pending]))
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            log.warning("%s can't be written: %s", path, error)

    def _recall(self) -> None:
        """Go on with what was pending when the service ended."""
        path = self.shelf.directory / PENDING
        try:
            told: list[list[Any]] = json.loads(path.read_text()) if path.exists() else []
            near = [Near.told(*one) for one in told]
        except (OSError, ValueError, TypeError) as error:
            log.warning("%s can't be read: %s", path, error)
        else:
            self.note(near)


def _least_missed(near: Sequence[Near]) -> int:
    """Which is the newest of the two vendors that have the most."""
    held = Counter(one.vendors for one in near)
    most = max(held.values())
    return max(row for row, one in enumerate(near) if held[one.vendors] == most)


def _cut(order: Order) -> Box | None:
    from deconflict.operator.blackbox.blackbox_writer import cut  # noqa: PLC0415 - brings numba

    return cut(order)
