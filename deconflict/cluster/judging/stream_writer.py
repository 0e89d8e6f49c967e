"""Writes revisions to the durable stream, each only after the one that it follows."""

import asyncio
import logging
import time
from collections import OrderedDict

from deconflict.advisories.situations.situation_lifecycle import stamped
from deconflict.cluster.ingest_feed import RETRY_S
from deconflict.cluster.judging.shard import REMEMBERED
from deconflict.cluster.nats.revision_stream import OverruledError, RevisionStream, UnwritableRevisionError
from deconflict.cluster.nats.stream_records import StreamRecord, key_of
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.runtime.set_asides import SetAsides
from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import AnyRevision, Situation, is_advisory
from ingest.batch import FloorPoint
from ingest.measures.measures import Measures

log = logging.getLogger(__name__)

DAY_S = 86400.0


class StreamWriter:
    """Knows the newest record of each key, and writes the next."""

    def __init__(self, revisions: RevisionStream, measures: Measures) -> None:
        self._stream, self._set_asides = revisions, SetAsides(measures)
        self._newest: OrderedDict[str, StreamRecord] = OrderedDict()
        """The newest record of the stream, by key."""
        self._situation_of: dict[str, str] = {}
        """The id of the open situation, by id of each advisory that it lists."""
        self._listed: dict[str, tuple[str, ...]] = {}
        """The advisories that each open situation lists, by its id."""

    def note(self, record: StreamRecord) -> None:
        """Take in a record of the stream."""
        if record.advisory is None:
            return
        known = self._newest.get(record.key)
        if known is None or known.seq < record.seq:
            self._newest[record.key] = record
            self._newest.move_to_end(record.key)
            if isinstance(record.advisory, Situation):
                self._note_situation(record.advisory)
                self._newest.move_to_end(record.key, last=_is_open(record))  # nothing follows a cleared situation
        while len(self._newest) > REMEMBERED:
            self._newest.popitem(last=False)

    def _note_situation(self, situation: Situation) -> None:
        for advisory_id in self._listed.pop(situation.id, ()):
            if self._situation_of.get(advisory_id) == situation.id:
                del self._situation_of[advisory_id]
        if situation.state is not AdvisoryState.CLEARED:
            self._listed[situation.id] = situation.advisories
            self._situation_of.update(dict.fromkeys(situation.advisories, situation.id))

    def open(self) -> list[AnyRevision]:
        """The newest revision of every open advisory and situation."""
        return [record.advisory for record in self._newest.values() if record.advisory and _is_open(record)]

    async def write(self, home: FloorPoint | None, advisory: AnyRevision) -> StreamRecord | None:
        """Write a revision, that of an advisory with the id of its situation, and retry as long as it takes.

        Returns None, or the record of another engine that stands in its place.
        """
        key = key_of(advisory)
        if is_advisory(advisory):
            advisory = stamped(advisory, self._situation_of.get(advisory.id))
        while True:
            last = self._newest.get(key)
            if last and last.advisory and not follows(advisory, last.advisory):
                return last
            try:
                if await self._try_write(key, home, advisory, last.seq if last else 0):
                    return None
            except BUS_ERRORS as error:
                self._stream.warn(f"a revision is not written yet: {error or type(error).__name__}")
            await asyncio.sleep(RETRY_S)

    async def _try_write(
        self, key: str, home: FloorPoint | None, advisory: AnyRevision, last_seq: int, *, again: bool = False
    ) -> bool:
        """Whether the stream accepted it after number `last_seq`; if not, notes the record that the stream has.

        A revision that no stream accepts is set aside, and counts as accepted. Raises `BUS_ERRORS`.
        """
        try:
            seq = await self._stream.write(home, advisory, last_seq, again=again)
        except OverruledError:
            self._newest.pop(key, None)  # the stream may have lost it, or be another one
            if record := await self._stream.last(key):
                self.note(record)
            return False
        except UnwritableRevisionError as error:
            self._set_asides.add("unwritable", f"{advisory.id}, revision {advisory.revision}", error)
            return True
        self.note(StreamRecord(seq, key, home, advisory))
        return True

    async def keep_complete(self) -> None:
        """Without end, write again what the stream has lost, everything if it is another one, and what expires soon."""
        replacements, lost = self._stream.replacements, list[StreamRecord]()
        every_s = min(self._stream.kept_s / 4, DAY_S)
        due_s = time.monotonic() + every_s
        while True:
            if replacements != self._stream.replacements:
                replacements, lost = self._stream.replacements, sorted(self._newest.values(), key=_is_open)
                self._newest.clear()
            try:
                while lost:
                    await self._restore(lost[-1])
                    lost.pop()
                if time.monotonic() >= due_s:
                    await self._renew_before(time.time() - self._stream.kept_s / 2)
                    due_s = time.monotonic() + every_s
            except BUS_ERRORS as error:
                log.warning("open advisories are not written again yet: %s", error or type(error).__name__)
            await asyncio.sleep(RETRY_S)

    async def _renew_before(self, before_s: float) -> None:
        """Write open advisories without a revision since `before_s` once more. Raises `BUS_ERRORS`."""
        for record in list(self._newest.values()):
            if record.advisory and _is_open(record) and record.advisory.updated_at.timestamp() < before_s:
                await self._try_write(record.key, record.home, record.advisory, record.seq, again=True)

    async def _restore(self, record: StreamRecord) -> None:
        """Write a record again if the stream lacks it. Raises `BUS_ERRORS`."""
        last = await self._stream.last(record.key)
        if last:
            self.note(last)
        if record.advisory and is_missing(record.advisory, last.advisory if last else None):
            await self._try_write(record.key, record.home, record.advisory, last.seq if last else 0)


def _is_open(record: StreamRecord) -> bool:
    return record.advisory is not None and record.advisory.state is not AdvisoryState.CLEARED


def is_missing(advisory: AnyRevision, last: AnyRevision | None) -> bool:
    """Whether a stream has lost a revision. `last` is the newest revision that it has of its key."""
    if last is None:
        return advisory.state is not AdvisoryState.CLEARED
    return last.id == advisory.id and last.revision < advisory.revision


def follows(advisory: AnyRevision, last: AnyRevision) -> bool:
    """Whether a revision is the next after the last one of its key."""
    if last.id == advisory.id:
        return advisory.revision == last.revision + 1
    return last.state is AdvisoryState.CLEARED and advisory.revision == 1
