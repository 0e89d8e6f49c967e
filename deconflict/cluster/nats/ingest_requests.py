"""Requests to all ingests: questions of operator faces, and requests of engines for all robots of some channels."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress

from nats.aio.msg import Msg

from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.nats.shared_state import SharedState
from deconflict.cluster.nats.subscriptions import BUS_ERRORS, MOST_PENDING_BYTES, MOST_PENDING_MESSAGES
from deconflict.cluster.tiles.tile_channels import MOST_BYTES


class IngestRequests:
    """Questions go to `NAME.ask`, requests for robots to `NAME.want`. Answers come to an inbox."""

    def __init__(self, connection: NatsConnection, state: SharedState) -> None:
        self._connection, self._state, self._name = connection, state, connection.name

    async def open_inbox(self, receive: Callable[[bytes], None]) -> str:
        """Receive the answers to `request_robots`; returns the address of the inbox."""
        address = self._connection.client.new_inbox()

        async def on_message(message: Msg) -> None:
            if message.data:  # it is empty if nobody answers
                receive(message.data)

        await self._connection.client.subscribe(
            address,
            cb=on_message,
            pending_msgs_limit=MOST_PENDING_MESSAGES,
            pending_bytes_limit=MOST_PENDING_BYTES,
        )
        return address

    async def request_robots(self, channels: Iterable[str], inbox: str) -> None:
        """Request all robots of some channels from every ingest. The parcels come to `inbox`."""
        data = json.dumps(sorted(channels)).encode()
        await self._connection.client.publish(f"{self._name}.want", data, reply=inbox)

    async def serve_robots(self, parcels_of: Callable[[set[str]], Awaitable[list[bytes]]]) -> None:
        """Answer `request_robots`. `parcels_of` gives the parcels of some channels."""

        async def on_request(message: Msg) -> None:
            for parcel in await parcels_of(set(json.loads(message.data))):
                await self._connection.client.publish(message.reply, parcel)

        await self._connection.client.subscribe(f"{self._name}.want", cb=on_request)

    async def ask(self, question: str, within_s: float) -> list[bytes]:
        """The answers of all ingests that come in time, ordered by name."""
        expected = self._state.ingests()
        parts: dict[str, list[bytes]] = {ingest: [] for ingest in expected}
        answers: dict[str, bytes] = {}
        complete = asyncio.Event()

        async def on_answer(message: Msg) -> None:
            headers = message.headers or {}
            if (ingest := headers.get("From", "")) in expected:
                parts[ingest].append(message.data)
                if len(parts[ingest]) == int(headers["Parts"]):
                    answers[ingest] = b"".join(parts[ingest])
            if answers.keys() == expected:
                complete.set()

        client = self._connection.client
        address = client.new_inbox()
        subscription = await client.subscribe(address, cb=on_answer, pending_bytes_limit=MOST_PENDING_BYTES)
        try:
            await client.publish(f"{self._name}.ask", question.encode(), reply=address)
            with suppress(TimeoutError):
                async with asyncio.timeout(within_s if expected else 0):
                    await complete.wait()
        finally:
            with suppress(*BUS_ERRORS):
                await subscription.unsubscribe()
        return [answers[ingest] for ingest in sorted(answers) if answers[ingest]]

    async def serve_questions(self, ingest: str, answer_to: Callable[[str], Awaitable[bytes]]) -> None:
        """Answer `ask` in the name of an ingest. An empty answer means that it has none."""

        async def on_question(message: Msg) -> None:
            answer = await answer_to(message.data.decode())
            parts = [answer[at : at + MOST_BYTES] for at in range(0, len(answer), MOST_BYTES)] or [b""]
            for part in parts:
                headers = {"From": ingest, "Parts": str(len(parts))}
                await self._connection.client.publish(message.reply, part, headers=headers)

        await self._connection.client.subscribe(f"{self._name}.ask", cb=on_question)
