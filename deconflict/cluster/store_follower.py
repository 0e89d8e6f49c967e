"""The follower's process: hands what the durable stream tells to the operator face beside it, under its numbers.

It also asks all ingests what the face wants to know of the robots.
"""

import asyncio
import json
import logging
from pathlib import Path
from typing import Any

from deconflict.advisory import Acknowledgement
from deconflict.cluster.ingest_calls import Ingests
from deconflict.cluster.ingest_feed import RETRY_S
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.stream_records import Line, Seen
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.nats.tasks import beating, connected, until
from deconflict.runtime.rpc import AsyncCaller, LinkDownError, listening, socket_path
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import Site

log = logging.getLogger(__name__)

MOST_AT_ONCE = 500


class AnotherStreamError(Exception):
    """What the operator face has stored is not of the stream that is to be followed."""

    def __init__(self) -> None:
        super().__init__(
            "the stored advisories are not of the stream that the NATS servers have now, or it has lost its end; "
            "they are set aside, and the stream is followed from its beginning"
        )


class Follower:
    """One operator face's ear, and its mouth for answers."""

    def __init__(self, site: Site, settings: Cluster, runtime: Path) -> None:
        self._bus, self._runtime = Bus(settings, site.store.keep_days), runtime
        self._operator = AsyncCaller(runtime, "operator")
        self._ingests = Ingests(self._bus)
        self._lines: asyncio.Queue[Line] = asyncio.Queue()

    async def run(self, stop: asyncio.Event) -> None:
        """Follow until `stop` is set."""
        if not await connected(self._bus, stop):
            return
        try:
            calls = {"answer": self._answer, "presence": self._presence, **self._ingests.calls()}
            async with listening(socket_path(self._runtime, "follower"), calls):
                await until(stop, self._follow(), self._stays(), beating(self._bus, self._measure), self._ingests.run())
        except AnotherStreamError as error:
            log.error("%s", error)
            await until(stop, self._begin_anew())
        finally:
            await self._bus.close()

    async def _follow(self) -> None:
        stored = Seen(*json.loads(await self._asked("stored")))
        if not await self._bus.goes_on_from(stored):
            raise AnotherStreamError
        await self._bus.hear_told(self._lines.put_nowait, after=stored)
        while True:
            lines = [await self._lines.get()]
            self._check()
            while not self._lines.empty() and len(lines) < MOST_AT_ONCE:
                lines.append(self._lines.get_nowait())
            await self._asked("told", json.dumps([_document(one) for one in lines]).encode())

    async def _stays(self) -> None:
        """Raises `AnotherStreamError` as soon as the stream is another, though nothing is told in it."""
        while True:
            self._check()
            await asyncio.sleep(RETRY_S)

    def _check(self) -> None:
        if self._bus.streams:
            raise AnotherStreamError

    async def _begin_anew(self) -> None:
        """Have the operator face set aside what it has stored and begin anew, as this does."""
        await self._asked("begin_anew")

    async def _asked(self, name: str, payload: bytes = b"") -> bytes:
        """The operator face's answer, asked again until there is one."""
        while True:
            try:
                return await self._operator.call(name, payload)
            except LinkDownError:
                await asyncio.sleep(RETRY_S)

    async def _measure(self) -> None:
        """Say that engines are there, what they measure, and who is still there."""
        members = self._bus.members().values()
        said = [one["measures"] for one in members if "measures" in one]
        if said:
            presence = next((one["presence"] for one in members if one.get("presence")), None)
            parcel: dict[str, Any] = {"measures": [one for each in said for one in each], "presence": presence}
            await self._asked("publish", json.dumps(parcel | {"advisories": [], "near_misses": []}).encode())

    async def _presence(self, _: bytes) -> bytes:
        """Whether the servers are in touch, and an ingest was heard of."""
        return json.dumps({"nats": self._bus.in_touch(), "ingest": bool(self._bus.ingests())}).encode()

    async def _answer(self, payload: bytes) -> bytes:
        """Put an answer into the stream; it comes back to every operator face with its number."""
        told = json.loads(payload)
        try:
            seq = await self._bus.answer(told["id"], Acknowledgement.model_validate(told["answer"]))
        except BUS_ERRORS as error:
            log.warning("an answer is not told: %s", error or type(error).__name__)
            seq = 0
        return json.dumps({"seq": seq}).encode()


def _document(line: Line) -> dict[str, Any]:
    told: dict[str, Any] = {"seq": line.seq, "id": line.key}
    if line.advisory:
        told["advisory"] = line.advisory.model_dump(mode="json")
    if line.answer:
        told["answer"] = line.answer.model_dump(mode="json")
    return told
