"""Publishing: store a revision, then wake the subscribers. A subscriber is only a position in the store.

A disk that fails or takes longer than `DISK_TIMEOUT_S` delays nothing: revisions are published, and the disk is tried
again. Subscribers may run on other event loops than the one that publishes.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Sequence, Set
from contextlib import suppress
from functools import partial
from itertools import islice
from threading import Lock
from typing import NamedTuple, TypeVar

from deconflict.operator.store.store import Store, StoreError
from deconflict.runtime.set_asides import SetAsides
from deconflict_client.advisory import EVERY_KIND, Acknowledgement
from deconflict_client.situations import AnyRevision
from ingest.measures.measures import Measures

log = logging.getLogger(__name__)

DISK_TIMEOUT_S = 0.5
STUCK_S = 4.0
"""If the store answers no question about a new revision for so long, memory takes the place of its file."""
LOOKS = 8
PRUNED = "deconflict_advisories_pruned_total"
TAIL_LENGTH = 1024
MOST_LINES = 100


Answer = TypeVar("Answer")


class PublishedLine(NamedTuple):
    """One revision as the stream sends it."""

    seq: int
    text: str
    kind: str


class PublishedPage(NamedTuple):
    """Lines of some kinds, ascending."""

    lines: list[PublishedLine]
    last: int
    """Up to this number these are all that are left."""
    removed: int
    """The highest number of one of these kinds that was removed and may be missing here; 0 if none is missing."""


class StreamEndedError(Exception):
    """The sequence numbers given so far are no longer valid."""


class News:
    """Wakes those who wait for the next revision, on any event loop."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._events: dict[asyncio.AbstractEventLoop, asyncio.Event] = {}

    def next(self) -> asyncio.Event:
        """An event of the running loop, which the next `announce` sets."""
        with self._lock:
            return self._events.setdefault(asyncio.get_running_loop(), asyncio.Event())

    def announce(self) -> None:
        with self._lock:
            events, self._events = self._events, {}
        for loop, event in events.items():
            with suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(event.set)


class Publisher:
    """Appends to the store off the event loop. Keeps the newest lines in memory, which all subscribers share.

    `after`, `reached` and `acknowledge` may be called on any event loop, everything else on the one that publishes.
    """

    def __init__(self, store: Store, measures: Measures) -> None:
        self._store, self.measures, self.set_asides = store, measures, SetAsides(measures)
        self.forward_answer: Callable[[str, Acknowledgement], Awaitable[None]] | None = None
        """Sends an answer to the stream that numbers it, and returns once it has come back. None if this store does."""
        self.heard_answer: Callable[[AnyRevision], None] | None = None
        """Hears each answer that is published, on the event loop that publishes."""
        self.loop: asyncio.AbstractEventLoop | None = None
        """The event loop that publishes; None if there is no other."""
        self._tail: deque[PublishedLine] = deque(maxlen=TAIL_LENGTH)
        self._tail_lock = Lock()
        self._appending = asyncio.Lock()
        self._news = News()
        self.last_seq = store.last_seq()
        """The newest published number."""
        self.failing: str | None = None
        """Why revisions are not stored at present; None if they are."""
        self._storing: asyncio.Task[None] | None = None
        self._noting: asyncio.Task[None] | None = None
        self._ended = False
        measures.begin("deconflict_advisories_stored_total", "deconflict_store_failures_total")
        measures.level("deconflict_store_unstored", {(): 0})

    async def publish(self, advisories: Sequence[AnyRevision]) -> list[AnyRevision]:
        """Store and publish revisions; returns them with their numbers.

        A revision that is sent again is published once. One that can't be written though others can is set aside.
        Raises `StoreError` if the store can't be read or too many revisions wait for it; then nothing is published.
        """
        async with self._appending:
            try:
                accepted = await self._answered(partial(self._store.accept, advisories))
            except Exception:
                self.measures.count("deconflict_store_failures_total")
                raise
            await self.store_pending()
            aside = self._set_aside()
            accepted = [revision for revision in accepted if revision.seq not in aside]
            self._announce([revision for revision in accepted if revision.seq > self.last_seq])
        return accepted

    def _set_aside(self) -> set[int]:
        """Set aside what the store could not write; returns the numbers."""
        numbers = set()
        while self._store.unwritable:
            revision, error = self._store.unwritable.popleft()
            self.set_asides.add("unwritable", f"{revision.id}, revision {revision.revision}", error)
            numbers.add(revision.seq)
        return numbers

    async def store_pending(self) -> None:
        """Store pending revisions and positions of outlets.

        Waits for the disk for at most `DISK_TIMEOUT_S`, and only once while it is stuck.
        """
        is_stuck = self.failing is not None and self._storing is not None and not self._storing.done()
        storing = self._begin_storing()
        await asyncio.wait({storing}, timeout=0 if is_stuck else DISK_TIMEOUT_S)
        if storing.done():
            storing.result()
        elif not self.failing:
            self._fail("the disk is slow")
        if self._store.unstored:
            await self._note_unstored()
        self.measures.level("deconflict_store_unstored", {(): self._store.unstored})

    async def _note_unstored(self) -> None:
        """Before numbers are given that are not on the disk. Waits for it as `store_pending` does."""
        is_stuck = self._noting is not None and not self._noting.done()
        if self._noting is None or not is_stuck:
            self._noting = asyncio.create_task(asyncio.to_thread(self._store.note_unstored))
        await asyncio.wait({self._noting}, timeout=0 if is_stuck else DISK_TIMEOUT_S)

    def _begin_storing(self) -> asyncio.Task[None]:
        """The task that stores pending writes; starts one if none runs."""
        if self._storing is None or self._storing.done():
            self._storing = asyncio.create_task(self._store_all())
        return self._storing

    async def renew_numbers(self) -> None:
        """The store has begun to use another database: perhaps with other numbers."""
        async with self._appending:
            await self._begin_anew()

    async def _begin_anew(self) -> None:
        with self._tail_lock:
            self._tail.clear()
        self.last_seq = await self._answered(self._store.last_seq)
        self._news.announce()

    async def _answered(self, question: Callable[[], Answer]) -> Answer:
        """The answer of the store: from memory, if its disk does not answer within `STUCK_S`."""
        asking = asyncio.create_task(asyncio.to_thread(question))
        for _ in range(LOOKS):  # time in which the whole process was stopped counts as one of them
            await asyncio.wait({asking}, timeout=STUCK_S / LOOKS)
        if asking.done() or not await self._has_left():
            return await asking
        asking.add_done_callback(lambda left: left.cancelled() or left.exception())  # nobody else asks for it
        return await self._answered(question)

    async def leave_stuck(self) -> None:
        """Go on without a file whose disk does not answer."""
        async with self._appending:
            await self._has_left()

    async def _has_left(self) -> bool:
        is_left = await asyncio.to_thread(self._store.leave_stuck)
        if is_left:
            self._storing = None
            await self._begin_anew()
        return is_left

    async def close(self) -> None:
        """Store the rest. Logs how many revisions the disk did not take."""
        await asyncio.wait({self._begin_storing()}, timeout=DISK_TIMEOUT_S)
        if self._store.unstored:
            log.error("%d revisions were published and never stored", self._store.unstored)

    async def _store_all(self) -> None:
        while self._store.has_pending:
            try:
                await asyncio.to_thread(self._store.flush)
            except StoreError as error:
                self.measures.count("deconflict_store_failures_total")
                self._fail(str(error))
                return
            except Exception:
                self.measures.count("deconflict_store_failures_total")
                log.exception("pending revisions can't be stored")
                self._fail("a fault of the program; see the log")
                return
        if self.failing:
            log.warning("advisories are stored again")
        self.failing = None

    def _fail(self, reason: str) -> None:
        if not self.failing:
            log.error("advisories are published but not stored: %s; they are stored once the disk works", reason)
        self.failing = reason

    async def acknowledge(self, advisory_id: str, answer: Acknowledgement) -> AnyRevision | None:
        """Store and publish an answer; returns the newest revision with it, or None for an unknown advisory."""
        answering = self._acknowledge(advisory_id, answer)
        if self.loop in (None, asyncio.get_running_loop()):
            return await answering
        return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(answering, self.loop))

    async def _acknowledge(self, advisory_id: str, answer: Acknowledgement) -> AnyRevision | None:
        if self.forward_answer is None:
            return await self.store_answer(advisory_id, answer)
        if not await asyncio.to_thread(self._store.get, advisory_id):
            return None
        await self.forward_answer(advisory_id, answer)
        return (await asyncio.to_thread(self._store.get, advisory_id))[-1]

    async def store_answer(
        self, advisory_id: str, answer: Acknowledgement, seq: int | None = None
    ) -> AnyRevision | None:
        """Store an answer and publish it. `seq` is its number if the followed stream gave one."""
        async with self._appending:
            await self.store_pending()
            answered = await self._answered(partial(self._store.accept_answer, advisory_id, answer, seq))
            await self.store_pending()
            if answered and answered.seq > self.last_seq:
                self._announce([answered])
                if self.heard_answer:
                    self.heard_answer(answered)
        return answered

    async def reached(self, seq: int) -> None:
        """Wait until the revision with a number is published. Raises `StreamEndedError`."""
        while True:
            news = self._news.next()
            if self.last_seq >= seq:
                return
            if self._ended:
                raise StreamEndedError
            await news.wait()

    def end(self) -> None:
        """Publish nothing more under these numbers."""
        self._ended = True
        self._news.announce()

    async def after(self, seq: int, kinds: Set[str] = EVERY_KIND, removed_to: int = 0) -> PublishedPage:
        """The lines of these kinds among the next numbers above `seq`, at most `MOST_LINES`, perhaps none.

        Waits for the next number. Raises `StoreError`. Has nothing that was removed from the store if `removed_to` is
        the highest removed number: the newest lines in memory may have the beginning of what was removed.
        """
        await self.reached(seq + 1)
        if seq >= removed_to and (lines := self._tail_after(seq)):
            return PublishedPage([line for line in lines if line.kind in kinds], lines[-1].seq, 0)
        known = self.last_seq
        page = await asyncio.to_thread(self._store.page_after, seq, kinds, MOST_LINES)
        last = known if page.last == seq else page.last
        return PublishedPage([_line(revision) for revision in page.revisions], last, page.removed)

    def _tail_after(self, seq: int) -> list[PublishedLine]:
        """The next lines above `seq`; none if the tail does not go back so far."""
        with self._tail_lock:
            if not self._tail or self._tail[0].seq > seq + 1:
                return []
            skipped = seq + 1 - self._tail[0].seq
            return list(islice(self._tail, skipped, skipped + MOST_LINES))

    def _announce(self, new: Sequence[AnyRevision]) -> None:
        if not new:
            return
        lines = sorted(_line(revision) for revision in new)
        with self._tail_lock:
            for line in lines:
                if self._tail and line.seq != self._tail[-1].seq + 1:
                    self._tail.clear()  # the tail has no gaps; a subscriber that is further back reads the store
                self._tail.append(line)
        self.last_seq = lines[-1].seq
        self.measures.count("deconflict_advisories_stored_total", by=len(new))
        self._news.announce()


def _line(revision: AnyRevision) -> PublishedLine:
    return PublishedLine(revision.seq, revision.model_dump_json(), revision.kind)
