"""NATS as the cluster uses it: parcels, told revisions, introductions, members and the table.

Nothing but this and `hearing` speaks to it.

Parcels go on `NAME.rows.CHANNEL` into a stream in memory that is kept for half a minute; revisions on `NAME.told.KEY`
into a durable one, whose sequence numbers are those of the advisories (`lines`).
"""

import asyncio
import json
import logging
import time
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress
from math import inf
from typing import Any
from uuid import uuid4

import nats
from nats.aio.msg import Msg
from nats.js import JetStreamContext, api
from nats.js.errors import APIError, BadRequestError, KeyNotFoundError, KeyWrongLastSequenceError, NotFoundError
from nats.js.kv import KeyValue

from deconflict.advisory import Acknowledgement, AnyAdvisory
from deconflict.cluster.nats.nats_credentials import credentials
from deconflict.cluster.nats.stream_records import Line, Seen, key_of, line, told_as
from deconflict.cluster.nats.subscriptions import BUS_ERRORS, PENDING, Hearing, lately, latest
from deconflict.cluster.tiles.channels import MOST_BYTES
from deconflict.cluster.tiles.tiles import Place
from deconflict.settings.cluster_settings import Cluster
from ingest.fleet.introductions import Introduction

log = logging.getLogger(__name__)

KEPT_S = 30.0
"""How long parcels are kept."""
INTRODUCED_BYTES = 1 << 26
"""For what robots say of themselves, of some hundred thousand of them."""
OFF_S = 5.0
"""A clock that differs by more is told of. What a member says is heard within `LEASE_S`."""
LEASE_S = 4.0
"""A member not heard of for this long is gone."""
SAME_S = 120.0
"""A revision that is sent again within this time is not doubled."""
CLOSE_S = 2.0
PING_S = 5
"""A server that answers no ping of two in a row is taken for lost."""
QUICK_S = 1.0
"""How long what a member says of itself may take: longer than that, and it is not heard of in time."""
AGAIN_S = 0.2
ERRORS_S = 10.0
WRONG_LAST_SEQUENCE, NO_MESSAGE = 10071, 10037
FEED = "feed-"
"""How the names of members that are ingests begin."""


class OverruledError(Exception):
    """Another has told something of that key in the meantime."""


class Bus:
    """One connection. Calls raise one of `BUS_ERRORS` while the server can't be had; hearing goes on by itself."""

    def __init__(self, settings: Cluster, keep_days: float) -> None:
        """Raises `SecretError` and `CertificateError`."""
        self._settings, self.name = settings, settings.name
        self.kept_s = 86400 * keep_days
        """How long what was told is kept."""
        self._voice = uuid4().hex
        """The server takes what it has heard of this name before for told, whatever it says now."""
        self._said: dict[str, tuple[float, dict[str, Any]]] = {}
        """By member, when it was heard of last by this machine's clock, and what it said."""
        self._credentials = credentials(settings)
        self._hearings: list[Hearing] = []
        self._reconnected = asyncio.Event()
        self._renewing: asyncio.Task[None] | None = None
        self._renewed_s = -inf
        self._warned_s: dict[str, float] = {}
        """When people were told something last."""
        self._seen: Seen | None = None
        """The line of what is told that was heard last."""
        self.streams = 0
        """How often the stream of what is told proved to be another than before, or to have lost its end."""
        self.renewals = 0
        """How often the connection was made again: what was on its way then may be lost."""

    async def open(self) -> None:
        """Connect, and make the streams and buckets where they are not there."""
        self._nats = await nats.connect(
            list(self._settings.nats),
            max_reconnect_attempts=-1,
            reconnect_time_wait=0.2,
            ping_interval=PING_S,
            **self._credentials,
            error_cb=self._told_of,
            reconnected_cb=self._connected_again,
        )
        self._js: JetStreamContext = self._nats.jetstream()
        self._quick: JetStreamContext = self._nats.jetstream(timeout=QUICK_S)
        try:
            await self._make()
            await self._hear(f"$KV.{self.name}-members.*", f"KV_{self.name}-members", self._met, latest)
        except BaseException:
            await self.close()
            raise
        self._renewing = asyncio.create_task(self._renew())

    async def _make(self) -> None:
        name, copies = self.name, self._settings.copies
        memory, disk = api.StorageType.MEMORY, api.StorageType.FILE
        await self._stream("rows", [f"{name}.rows.>"], memory, KEPT_S, SAME_S / 10)
        await self._stream("told", [f"{name}.told.*", f"{name}.answer.*"], disk, self.kept_s, SAME_S)
        await self._js.create_key_value(bucket=f"{name}-members", ttl=LEASE_S, storage=memory, replicas=copies)
        await self._js.create_key_value(bucket=f"{name}-table", storage=disk, replicas=copies)
        self._learned = await self._js.create_key_value(bucket=f"{name}-learned", storage=disk, replicas=copies)
        self._introduced = await self._js.create_key_value(
            bucket=f"{name}-introduced", max_bytes=INTRODUCED_BYTES, storage=disk, replicas=copies
        )
        self._table = await self._quick.key_value(f"{name}-table")

    async def close(self) -> None:
        if self._renewing:
            self._renewing.cancel()
        with suppress(*BUS_ERRORS):
            async with asyncio.timeout(CLOSE_S):
                await self._nats.close()

    async def _connected_again(self) -> None:
        self._reconnected.set()

    async def _renew(self) -> None:
        """Make again what a server that was started anew does not have, and begin every hearing again."""
        while True:
            await self._reconnected.wait()
            self._reconnected.clear()
            try:
                await self._make()
                await self._compare()
                for one in list(self._hearings):
                    await one.begin(self._js)
            except BUS_ERRORS as error:
                log.warning("%s is not yet in touch again: %s", self.name, error or type(error).__name__)
                self._reconnected.set()
                await asyncio.sleep(AGAIN_S)
            else:
                self._renewed_s = time.monotonic()
                self.renewals += 1
                log.warning("%s is in touch again", self.name)

    async def _told_of(self, error: Exception) -> None:
        """The client tries again five times a second, and people are told now and then."""
        self._warn(f"the NATS server: {error or type(error).__name__}")

    def _warn(self, text: str) -> None:
        now_s = time.monotonic()
        self._warned_s = {said: at_s for said, at_s in self._warned_s.items() if now_s - at_s <= ERRORS_S}
        if text not in self._warned_s:
            self._warned_s[text] = now_s
            log.warning("%s", text)

    async def _compare(self) -> None:
        if self._seen and not await self.goes_on_from(self._seen):
            log.error("%s: the NATS servers no longer have what they told, or are others", self.name)
            self._seen, self.streams = None, self.streams + 1

    async def goes_on_from(self, seen: Seen) -> bool:
        """Whether the stream is the one in which a line was seen, and has all that came after it."""
        if not seen.seq:
            return True
        with suppress(NotFoundError):
            if seen.id:
                found = await self._js.get_msg(f"{self.name}-told", seen.seq)
                return line(seen.seq, found.subject or "", found.data or b"").is_what_was(seen)
        state = (await self._js.stream_info(f"{self.name}-told")).state
        return state.first_seq <= seen.seq + 1 <= state.last_seq + 1

    def in_touch(self) -> bool:
        """Whether there is a connection to a server."""
        return bool(self._nats.is_connected)

    def knows_members(self) -> bool:
        """Whether every member that is alive has had the time to be heard of."""
        return time.monotonic() - self._renewed_s > LEASE_S

    async def _stream(
        self, kind: str, subjects: list[str], storage: api.StorageType, age_s: float, same_s: float
    ) -> None:
        wanted = api.StreamConfig(
            name=f"{self.name}-{kind}",
            subjects=subjects,
            storage=storage,
            max_age=age_s,
            duplicate_window=min(same_s, age_s),
            num_replicas=self._settings.copies,
        )
        try:
            await self._js.add_stream(wanted)
        except BadRequestError:  # it is there with other settings
            await self._js.update_stream(wanted)

    async def send_rows(self, channel: str, parcel: bytes) -> None:
        """One part of a batch; it waits for no answer."""
        await self._nats.publish(f"{self.name}.rows.{channel}", parcel)

    async def hear_rows(self, channel: str, take: Callable[[bytes], None]) -> Callable[[], Awaitable[None]]:
        """Take the parcels of a channel, those of the last seconds first; the answer ends it."""

        async def taken(message: Msg) -> None:
            take(message.data)

        heard, _ = await self._hear(f"{self.name}.rows.{channel}", f"{self.name}-rows", taken, lately)

        async def leave() -> None:
            self._hearings.remove(heard)
            await heard.end()

        return leave

    async def inbox(self, take: Callable[[bytes], None]) -> str:
        """An address for what is wanted."""
        address = self._nats.new_inbox()

        async def taken(message: Msg) -> None:
            if message.data:  # there is none where nobody answers
                take(message.data)

        await self._nats.subscribe(address, cb=taken, pending_msgs_limit=PENDING, pending_bytes_limit=1 << 30)
        return address

    async def want(self, channels: Iterable[str], inbox: str) -> None:
        """Ask every ingest for all the robots of channels; the parcels come to `inbox` as they are answered."""
        await self._nats.publish(f"{self.name}.want", json.dumps(sorted(channels)).encode(), reply=inbox)

    async def wanted(self, give: Callable[[set[str]], Awaitable[list[bytes]]]) -> None:
        """Answer others' `want`."""

        async def asked(message: Msg) -> None:
            for parcel in await give(set(json.loads(message.data))):
                await self._nats.publish(message.reply, parcel)

        await self._nats.subscribe(f"{self.name}.want", cb=asked)

    async def ask(self, question: str, within_s: float) -> list[bytes]:
        """What every ingest that is there answers, as far as it comes in time; by name."""
        wanted = self.ingests()
        parts: dict[str, list[bytes]] = {name: [] for name in wanted}
        answered: dict[str, bytes] = {}
        whole = asyncio.Event()

        async def taken(message: Msg) -> None:
            headers = message.headers or {}
            if (who := headers.get("From", "")) in wanted:
                parts[who].append(message.data)
                if len(parts[who]) == int(headers["Parts"]):
                    answered[who] = b"".join(parts[who])
            if answered.keys() == wanted:
                whole.set()

        address = self._nats.new_inbox()
        heard = await self._nats.subscribe(address, cb=taken, pending_bytes_limit=1 << 30)
        try:
            await self._nats.publish(f"{self.name}.ask", question.encode(), reply=address)
            with suppress(TimeoutError):
                async with asyncio.timeout(within_s if wanted else 0):
                    await whole.wait()
        finally:
            with suppress(*BUS_ERRORS):
                await heard.unsubscribe()
        return [answered[who] for who in sorted(answered) if answered[who]]

    async def asked(self, member: str, give: Callable[[str], Awaitable[bytes]]) -> None:
        """Answer others' `ask` in the name of an ingest; nothing is told by an empty answer."""

        async def taken(message: Msg) -> None:
            answer = await give(message.data.decode())
            cuts = [answer[at : at + MOST_BYTES] for at in range(0, len(answer), MOST_BYTES)] or [b""]
            for cut in cuts:
                await self._nats.publish(message.reply, cut, headers={"From": member, "Parts": str(len(cuts))})

        await self._nats.subscribe(f"{self.name}.ask", cb=taken)

    async def tell(self, home: Place | None, advisory: AnyAdvisory, last_seq: int, *, again: bool = False) -> int:
        """Its number in the stream, another one `again` where it was told before.

        Raises `OverruledError` where the last told of its key is not `last_seq`.
        """
        headers = {"Nats-Expected-Last-Subject-Sequence": str(last_seq)}
        if not again:
            headers["Nats-Msg-Id"] = f"{self._voice}:{advisory.id}:{advisory.revision}"
        try:
            told = await self._js.publish(
                f"{self.name}.told.{key_of(advisory)}", told_as(home, advisory), headers=headers
            )
        except APIError as error:
            if error.err_code == WRONG_LAST_SEQUENCE:
                raise OverruledError from error
            raise
        return told.seq

    async def last_told(self, key: str) -> Line | None:
        """The newest revision under a key; None where the stream has none, or none any more."""
        try:
            found = await self._js.get_last_msg(f"{self.name}-told", f"{self.name}.told.{key}")
        except NotFoundError as error:
            if error.err_code == NO_MESSAGE:
                return None
            raise
        return line(found.seq or 0, found.subject or "", found.data or b"")

    async def answer(self, advisory_id: str, answer: Acknowledgement) -> int:
        told = await self._js.publish(f"{self.name}.answer.{advisory_id}", answer.model_dump_json().encode())
        return told.seq

    async def hear_told(self, take: Callable[[Line], None], after: Seen | None = None) -> int:
        """Take what is told after a line; without one, the newest of each key first. How many wait already.

        It goes on by itself where the stream is another one, too, from its beginning; `streams` says so before.
        """
        self._seen = after

        async def taken(message: Msg) -> None:
            seq = message.metadata.sequence.stream
            if self._seen is None or seq > self._seen.seq:
                told = line(seq, message.subject, message.data)
                self._seen = told.seen()
                take(told)

        def since() -> api.ConsumerConfig:
            if after is None and self._seen is None:
                return latest()
            first = self._seen.seq + 1 if self._seen else 1
            return api.ConsumerConfig(deliver_policy=api.DeliverPolicy.BY_START_SEQUENCE, opt_start_seq=first)

        subject = f"{self.name}.told.*" if after is None else f"{self.name}.>"
        _, waiting = await self._hear(subject, f"{self.name}-told", taken, since)
        return waiting

    async def _hear(
        self,
        subject: str,
        stream: str,
        taken: Callable[[Msg], Awaitable[None]],
        config: Callable[[], api.ConsumerConfig],
    ) -> tuple[Hearing, int]:
        """The subscription, and how many messages there are for it already."""
        hearing = Hearing(subject, stream, taken, config)
        try:
            waiting = await hearing.begin(self._js)
        except BaseException:
            await hearing.end()
            raise
        self._hearings.append(hearing)
        return hearing, waiting

    async def beat(self, member: str, says: dict[str, Any]) -> None:
        """Say that a member is there, and what it has to say."""
        said = says | {"at_s": time.time()}
        await self._quick.publish(f"$KV.{self.name}-members.{member}", json.dumps(said).encode())

    def members(self) -> dict[str, dict[str, Any]]:
        """What every member said last that was heard of within `LEASE_S`."""
        heard_s = time.monotonic() - LEASE_S
        self._said = {name: one for name, one in self._said.items() if one[0] >= heard_s}
        return {name: said for name, (_, said) in self._said.items()}

    def ingests(self) -> set[str]:
        """The members that are ingests."""
        return {name for name in self.members() if name.startswith(FEED)}

    async def _met(self, message: Msg) -> None:
        member, said = message.subject.rsplit(".", 1)[1], json.loads(message.data or b"{}")
        self._said[member] = time.monotonic(), said
        off_s = said.get("at_s", now_s := time.time()) - now_s
        if abs(off_s) > OFF_S:
            self._warn(f"the clock of {member} differs by {off_s:.0f} s from this machine's; have both set by NTP")

    async def keep(self, name: str, data: bytes) -> None:
        """Keep some bytes for whoever begins later; what is too large for the server is not kept."""
        if self._fits(name, data):
            await self._learned.put(name, data)

    async def kept(self, name: str) -> bytes | None:
        """What was kept last under a name."""
        return (await _found(self._learned, name))[1]

    async def introduce(self, one: Introduction) -> None:
        """Keep what a robot has said of itself, unless that is known, or something newer, or another vendor's word."""
        data = json.dumps(one.document()).encode()
        while self._fits(one.uuid, data):
            last, kept = await _found(self._introduced, one.uuid)
            if not one.is_news_to(Introduction.of_document(json.loads(kept)) if kept else None):
                return
            with suppress(KeyWrongLastSequenceError):
                await self._introduced.update(one.uuid, data, last=last)
                return

    async def hear_introductions(self, take: Callable[[Introduction], None]) -> None:
        """Take what each robot has said of itself, and what it will say."""

        async def taken(message: Msg) -> None:
            if message.data:
                take(Introduction.of_document(json.loads(message.data)))

        bucket = f"{self.name}-introduced"
        await self._hear(f"$KV.{bucket}.*", f"KV_{bucket}", taken, latest)

    def _fits(self, key: str, data: bytes) -> bool:
        if len(data) <= self._nats.max_payload:
            return True
        log.warning("%s takes %s bytes, and the NATS server no more than %s", key, len(data), self._nats.max_payload)
        return False

    async def table(self) -> tuple[int, dict[str, Any] | None]:
        """The table as it was written last, and what number that has."""
        last, written = await _found(self._table, "table")
        return last, json.loads(written or b"null")

    async def write_table(self, document: dict[str, Any], last: int) -> bool:
        """Whether it could be written in place of the one with that number."""
        try:
            await self._table.update("table", json.dumps(document).encode(), last=last)
        except KeyWrongLastSequenceError:
            return False
        return True


async def _found(bucket: KeyValue, key: str) -> tuple[int, bytes | None]:
    """The number and the bytes of what was put last under a key; 0 and None where there is nothing."""
    try:
        entry = await bucket.get(key)
    except KeyNotFoundError:
        return 0, None
    return entry.revision or 0, entry.value
