"""Tells revisions to the durable stream, each only after the one that it follows."""

import asyncio
import logging
import time
from collections import OrderedDict

from deconflict.advisory import AdvisoryState, AnyAdvisory
from deconflict.cluster.ingest_feed import RETRY_S
from deconflict.cluster.judging.shard import REMEMBERED
from deconflict.cluster.nats.bus import Bus, OverruledError
from deconflict.cluster.nats.stream_records import Line, key_of
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.tiles.tiles import Place

log = logging.getLogger(__name__)


DAY_S = 86400.0


class Teller:
    """What the stream has, and the way into it."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._last: OrderedDict[str, Line] = OrderedDict()
        """What the stream has last, by key."""

    def know(self, line: Line) -> None:
        """Take in a line of the stream."""
        if line.advisory is None:
            return
        known = self._last.get(line.key)
        if known is None or known.seq < line.seq:
            self._last[line.key] = line
            self._last.move_to_end(line.key)
        while len(self._last) > REMEMBERED:
            self._last.popitem(last=False)

    def open(self) -> list[AnyAdvisory]:
        """Every advisory that is open, as it was told last."""
        return [line.advisory for line in self._last.values() if line.advisory and _is_open(line)]

    async def tell(self, home: Place | None, advisory: AnyAdvisory) -> Line | None:
        """Tell one, however long it takes: None, or where another has told something else, what stands there."""
        key = key_of(advisory)
        while True:
            last = self._last.get(key)
            if last and last.advisory and not follows(advisory, last.advisory):
                return last
            try:
                if await self._told(key, home, advisory, last.seq if last else 0):
                    return None
            except BUS_ERRORS as error:
                log.warning("a revision is not told yet: %s", error or type(error).__name__)
            await asyncio.sleep(RETRY_S)

    async def _told(
        self, key: str, home: Place | None, advisory: AnyAdvisory, after: int, *, again: bool = False
    ) -> bool:
        """Whether the stream took it after that number; if not, what it has in its place is known now.

        Raises `BUS_ERRORS`.
        """
        try:
            seq = await self._bus.tell(home, advisory, after, again=again)
        except OverruledError:
            self._last.pop(key, None)  # the stream may have lost it, or be another
            if stands := await self._bus.last_told(key):
                self.know(stands)
            return False
        self.know(Line(seq, key, home, advisory))
        return True

    async def keep(self) -> None:
        """For ever have the stream told again what it lost, as one that is another has all, and what it will forget."""
        streams, lost = self._bus.streams, list[Line]()
        every_s = min(self._bus.kept_s / 4, DAY_S)
        due_s = time.monotonic() + every_s
        while True:
            if streams != self._bus.streams:
                streams, lost = self._bus.streams, sorted(self._last.values(), key=_is_open)
                self._last.clear()
            try:
                while lost:
                    await self._tell_again(lost[-1])
                    lost.pop()
                if time.monotonic() >= due_s:
                    await self._tell_old(time.time() - self._bus.kept_s / 2)
                    due_s = time.monotonic() + every_s
            except BUS_ERRORS as error:
                log.warning("what is open is not told again yet: %s", error or type(error).__name__)
            await asyncio.sleep(RETRY_S)

    async def _tell_old(self, before_s: float) -> None:
        """Tell what is open and has had no revision since then once more, as it stands. Raises `BUS_ERRORS`."""
        for line in list(self._last.values()):
            if line.advisory and _is_open(line) and line.advisory.updated_at.timestamp() < before_s:
                await self._told(line.key, line.home, line.advisory, line.seq, again=True)

    async def _tell_again(self, line: Line) -> None:
        """Tell what is open and not there, and what is newer than what is there. Raises `BUS_ERRORS`."""
        stands = await self._bus.last_told(line.key)
        if stands:
            self.know(stands)
        if line.advisory and is_missing(line.advisory, stands.advisory if stands else None):
            await self._told(line.key, line.home, line.advisory, stands.seq if stands else 0)


def _is_open(line: Line) -> bool:
    return line.advisory is not None and line.advisory.state is not AdvisoryState.CLEARED


def is_missing(advisory: AnyAdvisory, last: AnyAdvisory | None) -> bool:
    """Whether a stream lacks a revision that was told before, given the last one that it has of its key."""
    if last is None:
        return advisory.state is not AdvisoryState.CLEARED
    return last.id == advisory.id and last.revision < advisory.revision


def follows(advisory: AnyAdvisory, last: AnyAdvisory) -> bool:
    """Whether a revision is the next after the last one of its key."""
    if last.id == advisory.id:
        return advisory.revision == last.revision + 1
    return last.state is AdvisoryState.CLEARED and advisory.revision == 1
