"""The calls that the operator face answers: the engine's, and in a cluster the follower's."""

import asyncio
import json
import logging
import time
from collections.abc import Awaitable, Callable, Iterable
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

from deconflict.operator.blackbox.blackbox_request import NearPair
from deconflict.operator.blackbox.keeper import Keeper
from deconflict.operator.http.api_sources import SourceUnavailableError
from deconflict.operator.ledger.loss_ledger import LedgerEntry, LossParcel
from deconflict.operator.ledger.optional_ledger import OptionalLedger
from deconflict.operator.store.learned_file import LearnedFile
from deconflict.operator.store.optional.optional_store import OptionalStore
from deconflict.operator.store.pending_writes import DiskWork
from deconflict.operator.store.publisher import Publisher, StreamEndedError
from deconflict.operator.store.store import StoreError
from deconflict.operator.store.tables import UnreadableAdvisoryError
from deconflict.roles.engine_link.live_situations import LiveSituations
from deconflict.roles.engine_link.restoration import page_of_encounters, page_of_open
from deconflict.roles.operator_sources import EngineReport, OperatorSources
from deconflict.roles.role_files import ALONE_FILE
from deconflict.runtime.parcels import REFUSED, STORED, unpacked_parcel
from deconflict.runtime.rpc import AsyncCaller, Handler, LinkDownError
from deconflict_client.advisory import ADVICE, Acknowledgement
from deconflict_client.situations import AnyRevision
from ingest.measures.lasting_loops import going_on
from ingest.measures.measures import Measures

ANSWER_TIMEOUT_S = 5.0
LEARNED_TIMEOUT_S = 3.0
Result = TypeVar("Result")
MOST_ANSWERS = 200
"""Most revisions of advice that are read for answers at once."""

log = logging.getLogger(__name__)


class OperatorCalls:
    """One method for each call; `handlers` has their names."""

    def __init__(
        self,
        runtime: Path,
        store: OptionalStore,
        publisher: Publisher,
        sources: OperatorSources,
        engine: EngineReport,
        learned_file: LearnedFile,
        keeper: Keeper,
        face_measures: Measures,
        ledger: OptionalLedger,
        situations: LiveSituations,
    ) -> None:
        """`face_measures` are those of the HTTP application."""
        self._runtime, self._store, self._publisher, self._sources = runtime, store, publisher, sources
        self._engine, self._learned_file, self._keeper = engine, learned_file, keeper
        self._unwritten = b""
        """The learned state to be written."""
        self._learning = DiskWork(self._write_learned)
        self._ledger, self._situations = ledger, situations
        self._own_measures = publisher.measures, face_measures
        self.other_numbers = asyncio.Event()
        """Set if this face is to publish under other numbers. Then the role restarts."""
        self.is_another_stream = False
        """Whether the stored advisories do not belong to the stream that is followed."""

    def handlers(self) -> dict[str, Handler]:
        return {
            "restore": self._restore,
            "encounters": self._encounters,
            "burdens": self._burdens,
            "learned": self._learned,
            "learn": self._learn,
            "under_way": self._under_way,
            "unlearn": self._unlearn,
            "unlearn_parts": self._unlearn_parts,
            "publish": self._publish,
            "answers": self._answers,
            "last_stored": self._last_stored,
            "store_lines": self._store_lines,
            "last_losses": self._last_losses,
            "add_losses": self._add_stream_losses,
            "begin_anew": self._begin_anew,
            "stand_alone": partial(self._stand, alone=True),
            "follow_stream": partial(self._stand, alone=False),
            "measures": self._measures,
            "health": self._health,
            "notice": self._notice,
        }

    async def settled(self, within_s: float) -> None:
        """Wait until the disk has what was taken in, or so long."""
        await asyncio.gather(self._learning.settled(within_s), self._keeper.noting.settled(within_s))

    async def forward_answer(self, advisory_id: str, answer: Acknowledgement) -> None:
        """Have the follower put an answer into the stream, and wait until the stream returns it."""
        payload = json.dumps({"id": advisory_id, "answer": answer.model_dump(mode="json")}).encode()
        try:
            seq = json.loads(await AsyncCaller(self._runtime, "follower").call("answer", payload))["seq"]
            async with asyncio.timeout(ANSWER_TIMEOUT_S):
                await self._publisher.reached(seq)
        except (LinkDownError, TimeoutError, StreamEndedError) as error:
            raise SourceUnavailableError("follower") from error
        if not seq:
            raise SourceUnavailableError("NATS server")

    async def _restore(self, after: bytes) -> bytes:
        self._store.note_engine()
        return await asyncio.to_thread(page_of_open, self._store, int(after))

    async def _encounters(self, after: bytes) -> bytes:
        a, b = json.loads(after)
        return await asyncio.to_thread(page_of_encounters, self._store, (a, b))

    async def _burdens(self, _: bytes) -> bytes:
        return json.dumps(await asyncio.to_thread(self._store.burdens_s)).encode()

    async def _learned(self, _: bytes) -> bytes:
        """The learned state with which a new engine resumes."""
        learned = await self._unless_stuck(self._learned_file.read, b"")
        await asyncio.to_thread(self._keeper.engine_started, learned)
        return learned

    async def _under_way(self, under_way: bytes) -> bytes:
        """What the engine has under way at the tick of the learned state that comes next."""
        self._keeper.note_under_way(under_way)
        return b"kept"

    async def _learn(self, learned: bytes) -> bytes:
        self._unwritten = learned
        await self._learning.do()  # no advisory waits for the disk
        await asyncio.to_thread(self._keeper.add_snapshot, learned)
        return b"kept"

    def _write_learned(self) -> None:
        self._learned_file.write(self._unwritten)

    async def _unlearn(self, reason: bytes) -> bytes:
        """Set the whole learned state aside: the engine starts without it."""
        await self._unless_stuck(partial(self._learned_file.set_aside, reason.decode()), None)
        await asyncio.to_thread(self._keeper.engine_started, b"")
        return b"set aside"

    async def _unlearn_parts(self, reasons: bytes) -> bytes:
        """Set aside the parts of the learned state with which the engine does not go on."""
        await self._unless_stuck(partial(self._learned_file.set_parts_aside, json.loads(reasons)), None)
        return b"set aside"

    async def _unless_stuck(self, work: Callable[[], Result], otherwise: Result) -> Result:
        """What the disk makes of it: an engine that starts does not wait for one that does not answer."""
        working = asyncio.create_task(asyncio.to_thread(work))
        if (await asyncio.wait({working}, timeout=LEARNED_TIMEOUT_S))[0]:
            return working.result()
        log.error("%s: its disk does not answer; the engine starts without it", self._learned_file.path)
        return otherwise

    async def _publish(self, payload: bytes) -> bytes:
        """Take in a parcel of the engine: revisions, near misses, and once a second measures and presence."""
        head, lines = unpacked_parcel(payload)
        self._engine.received_s = time.monotonic()
        with going_on("taking the measures of the engine", self._publisher.measures):
            self._take_measures(head)
        passes_s = head.get("passes_s", ())
        revisions = map(self._publisher.set_asides.revision_of, lines)
        if (lines or passes_s) and not await self._is_published(revisions, self._situations.publish):
            return REFUSED
        with going_on("taking what comes beside advisories", self._publisher.measures):
            await self._take_beside(head)
        self._situations.follow(passes_s)  # last, since it competes with threads that the engine waits for
        return self._taken()

    def _take_measures(self, head: dict[str, Any]) -> None:
        if "queued_s" in head:
            self._engine.delivery.arrived(head["queued_s"])
        self._engine.presence = head.get("presence") or self._engine.presence
        if head.get("measures"):
            self._engine.delivery.note_measures(head["measures"], self._engine.received_s)
            self._engine.measures = head["measures"]

    async def _take_beside(self, head: dict[str, Any]) -> None:
        if head.get("canary"):
            self._engine.canary.arrived(head["canary"])
        if head.get("near_misses"):
            pairs = [NearPair.from_json(*near_miss) for near_miss in head["near_misses"]]
            self._keeper.note(pairs)
            await self._keeper.noting.do()  # no advisory waits for the disk
        if head.get("losses"):
            self._add_losses(**head["losses"])

    async def _answers(self, after: bytes) -> bytes:
        """The answers to advice above a number of the stream, and the last number; the second alone if it is -1."""
        if int(after) < 0:
            return json.dumps({"last": await asyncio.to_thread(self._store.last_seq), "answers": []}).encode()
        page = await asyncio.to_thread(self._store.page_after, int(after), {ADVICE}, MOST_ANSWERS)
        rows = ((each.id, each.acknowledgement) for each in page.revisions)
        found = [(advice_id, given.answer, given.reason) for advice_id, given in rows if given and given.answer]
        return json.dumps({"last": page.last, "answers": found}).encode()

    def _add_losses(self, sender: str, number: int, entries: list[list[Any]]) -> None:
        self._ledger.add(LossParcel(sender, number, [LedgerEntry(*entry) for entry in entries]))

    async def _last_losses(self, _: bytes) -> bytes:
        """The last parcel of losses that the ledger has: its sender and its number."""
        return json.dumps(await asyncio.to_thread(self._ledger.last_parcel)).encode()

    async def _add_stream_losses(self, payload: bytes) -> bytes:
        self._add_losses(**json.loads(payload))
        return STORED

    async def _last_stored(self, _: bytes) -> bytes:
        """The last stored line of the stream that is followed: a `StreamPosition`."""
        seq = self._store.last_seq()
        last = next(iter(self._store.after(seq - 1, 1)), None) if seq else None
        return json.dumps([seq, last.id, last.revision] if last else [seq, "", 0]).encode()

    async def _store_lines(self, payload: bytes) -> bytes:
        """Store lines of the stream, in its order and under its numbers."""
        if self._sources.is_alone:
            return REFUSED
        parcel = json.loads(payload)
        self._engine.delivery.arrived(parcel["queued_s"])
        for is_answer, lines in groupby(parcel["lines"], lambda line: "answer" in line):
            if is_answer:
                for line in lines:
                    await self._store_answer(line)
                continue
            documents = (line["advisory"] | {"seq": line["seq"]} for line in lines)
            revisions = map(self._publisher.set_asides.revision_of, documents)
            if not await self._is_published(revisions, self._publisher.publish):
                return REFUSED
        return self._taken()

    def _taken(self) -> bytes:
        """The answer to a parcel that is stored."""
        self._engine.delivery.taken(time.monotonic())
        self._engine.delivery.set_aside(self._publisher.set_asides.last_s)
        return STORED

    async def _store_answer(self, line: dict[str, Any]) -> None:
        try:
            answer = Acknowledgement.model_validate(line["answer"])
            await self._publisher.store_answer(line["id"], answer, line["seq"])
        except (ValueError, UnreadableAdvisoryError) as error:
            self._publisher.set_asides.add("invalid", f"an answer to {line['id']}", error)

    async def _is_published(
        self, revisions: Iterable[AnyRevision | None], publish: Callable[[list[AnyRevision]], Awaitable[object]]
    ) -> bool:
        """Publish revisions. False if the store takes none now."""
        accepted = [revision for revision in revisions if revision]
        try:
            await publish(accepted)
        except StoreError as error:
            log.warning("%d revisions are not taken yet and will be sent again: %s", len(accepted), error)
            return False
        return True

    async def _begin_anew(self, _: bytes) -> bytes:
        """Have the role set aside its store, which is not of the stream that is followed, and end."""
        self.is_another_stream = True
        self.other_numbers.set()
        return b"set aside"

    async def _stand(self, _: bytes, *, alone: bool) -> bytes:
        """Take decisions from the engine of this machine, since no NATS server is connected, or from the stream; from
        the next start on if this face does not yet."""
        if alone == self._sources.is_alone:
            return STORED
        mark = self._runtime / ALONE_FILE
        if alone:
            mark.touch()
        else:
            mark.unlink(missing_ok=True)
        self.other_numbers.set()
        return REFUSED

    async def _measures(self, _: bytes) -> bytes:
        own = [measures.as_document() for measures in self._own_measures]
        return json.dumps([*await self._sources.measures(), *own]).encode()

    async def _health(self, _: bytes) -> bytes:
        return json.dumps(await self._sources.health()).encode()

    async def _notice(self, text: bytes) -> bytes:
        """Set the sentence that the page shows below its title."""
        self._sources.notice = text.decode()
        return b"shown"
