"""The follower's process: passes the durable stream on to the operator face of this machine, under its numbers.

It also answers that role's questions on the robots, from all ingests.
"""

import asyncio
import json
import logging
import time
from collections.abc import Iterable
from math import inf
from pathlib import Path
from typing import Any
from uuid import uuid4

from deconflict.cluster.ingest_calls import IngestCalls
from deconflict.cluster.ingest_feed import RETRY_S
from deconflict.cluster.members_health import UNHEARD, members_document, unknown_members
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.member_roster import part_of
from deconflict.cluster.nats.nats_tasks import answered, beat_repeatedly, call_last, open_bus, run_until
from deconflict.cluster.nats.stream_records import StreamPosition, StreamRecord
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.engine.canary.canary_parcel import oldest_canary
from deconflict.operator.ledger.loss_ledger import LossParcel
from deconflict.runtime.parcels import REFUSED, packed_parcel
from deconflict.runtime.rpc import AsyncCaller, LinkDownError, listening, socket_path
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import Site
from deconflict_client.advisory import Acknowledgement

log = logging.getLogger(__name__)

MOST_AT_ONCE = 500


class AnotherStreamError(Exception):
    """The stored advisories do not belong to the stream that the follower is to follow."""

    def __init__(self) -> None:
        super().__init__(
            "the stored advisories are not those of the NATS servers' stream, or the stream has lost its end; "
            "they are set aside, and the stream is followed from its beginning"
        )


class StoreFollower:
    """Connects one operator face to the cluster."""

    def __init__(self, site: Site, settings: Cluster, runtime: Path) -> None:
        self._bus, self._settings, self._runtime = Bus(settings, site.store.keep_days), settings, runtime
        self._name = f"face-{uuid4().hex[:12]}"
        self._operator = AsyncCaller(runtime, "operator")
        self._ingests = IngestCalls(self._bus)
        self._records: asyncio.Queue[StreamRecord] = asyncio.Queue()
        self._losses: asyncio.Queue[LossParcel] = asyncio.Queue()
        self._canary_due_s = -inf
        """When the newest canary was due that the operator face has, Unix time."""

    async def run(self, stop: asyncio.Event) -> None:
        """Follow until `stop` is set."""
        if not await open_bus(self._bus, stop):
            return
        try:
            own = {"answer": self._answer, "presence": self._presence, "members": self._members}
            async with listening(socket_path(self._runtime, "follower"), own | self._ingests.handlers()):
                repeated = [beat_repeatedly(self._bus, each) for each in (self._beat, self._report_engines)]
                following = self._follow(), self._follow_losses(), self._check_stream_repeatedly()
                await run_until(stop, *following, *repeated, self._ingests.run())
            await call_last(self._bus, self._bus.roster.leave)
        except AnotherStreamError as error:
            log.error("%s", error)
            await run_until(stop, self._begin_anew())
        finally:
            await self._bus.close()

    async def _follow(self) -> None:
        stored = StreamPosition(*json.loads(await self._call_operator("last_stored")))
        if not await answered(lambda: self._bus.revisions.continues_from(stored)):
            raise AnotherStreamError
        await answered(lambda: self._bus.revisions.follow(self._records.put_nowait, after=stored))
        while True:
            records, queued_s = [await self._records.get()], time.monotonic()
            self._check_stream()
            while not self._records.empty() and len(records) < MOST_AT_ONCE:
                records.append(self._records.get_nowait())
            parcel = json.dumps({"queued_s": queued_s, "lines": [_document(record) for record in records]}).encode()
            while await self._call_operator("store_lines", parcel) == REFUSED:
                await asyncio.sleep(RETRY_S)

    async def _follow_losses(self) -> None:
        """Add the losses of all engines to the ledger of the operator face."""
        sender, number = json.loads(await self._call_operator("last_losses"))
        await answered(lambda: self._bus.losses.follow(self._losses.put_nowait, sender, number))
        while True:
            record = await self._losses.get()
            await self._call_operator("add_losses", json.dumps(record._asdict()).encode())

    async def _check_stream_repeatedly(self) -> None:
        """Raises `AnotherStreamError` as soon as the stream is another one, even while it has no new record."""
        while True:
            self._check_stream()
            await asyncio.sleep(RETRY_S)

    def _check_stream(self) -> None:
        if self._bus.revisions.replacements:
            raise AnotherStreamError

    async def _begin_anew(self) -> None:
        """Have the operator face set aside its store and restart, as this process does."""
        await self._call_operator("begin_anew")

    async def _call_operator(self, name: str, payload: bytes = b"") -> bytes:
        """The operator face's answer. Retries until it answers."""
        while True:
            try:
                return await self._operator.call(name, payload)
            except LinkDownError:
                await asyncio.sleep(RETRY_S)

    async def _beat(self) -> None:
        await self._bus.beat(self._name, {})

    async def _report_engines(self) -> None:
        """Report to the operator face that engines are alive: their measures, robots' presence, and a canary."""
        members = self._bus.state.members().values()
        engines = [member for member in members if "measures" in member]
        if engines:
            presence = next((member["presence"] for member in engines if member.get("presence")), None)
            if presence:
                distrusted = {uuid for member in engines for uuid in member.get("distrusted", ())}
                presence = presence | {"distrusted": sorted(distrusted)}
            documents = [document for member in engines for document in member["measures"]]
            head = {"measures": documents, "presence": presence, "canary": self._new_canary(engines)}
            await self._call_operator("publish", packed_parcel(head))

    def _new_canary(self, engines: Iterable[dict[str, Any]]) -> dict[str, Any] | None:
        """The canary that every engine has judged since the last call, due in monotonic time; None if there is none."""
        canary = oldest_canary(member.get("canary") for member in engines)
        if canary is None or canary["due_s"] == self._canary_due_s:
            return None
        self._canary_due_s = canary["due_s"]
        return canary | {"due_s": canary["due_s"] + time.monotonic() - time.time()}

    async def _presence(self, _: bytes) -> bytes:
        """Whether a server is connected, and whether an ingest is alive."""
        up = {"nats": self._bus.connection.is_connected(), "ingest": bool(self._bus.state.ingests())}
        return json.dumps(up).encode()

    async def _members(self, _: bytes) -> bytes:
        """The part `members` of the health. A face that does not hear itself does not know who is there."""
        there = self._bus.state.working()
        if self._name in there and self._bus.state.knows_members():
            document = members_document(self._settings, map(part_of, there), self._bus.roster.gone())
        else:
            document = unknown_members(UNHEARD)
        return json.dumps(document).encode()

    async def _answer(self, payload: bytes) -> bytes:
        """Write an answer to the stream, which returns it to every operator face with its number.

        The result has that number; 0 if no server accepted it.
        """
        document = json.loads(payload)
        try:
            answer = Acknowledgement.model_validate(document["answer"])
            seq = await self._bus.revisions.write_answer(document["id"], answer)
        except BUS_ERRORS as error:
            log.warning("an answer is not written: %s", error or type(error).__name__)
            seq = 0
        return json.dumps({"seq": seq}).encode()


def _document(record: StreamRecord) -> dict[str, Any]:
    document: dict[str, Any] = {"seq": record.seq, "id": record.key}
    if record.advisory:
        document["advisory"] = record.advisory.model_dump(mode="json")
    if record.answer:
        document["answer"] = record.answer.model_dump(mode="json")
    return document
