"""The advisory stream: a WebSocket that follows the store from a given position (`docs/api.md`)."""

import asyncio
from collections.abc import Callable, Coroutine, Set
from contextlib import suppress
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect

from deconflict.operator.store.publisher import Publisher, StreamEndedError
from deconflict.operator.store.store import Store, StoreError
from deconflict.runtime.until_either import until_either
from deconflict_client.advisory import ADVISORY_KINDS, EVERY_KIND
from deconflict_client.situations import BAD_AFTER, BAD_KINDS, POSITION_LOST, STORE_FAILED, chosen_kinds
from ingest.measures.measures import Measures

MOST_DIGITS = 18
"""Most digits of `after`; the store counts no further."""


class RefusedError(Exception):
    """The stream can't start at the position that the subscriber asks for, or can't go on."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


class AdvisoryStream:
    """Serves each subscriber until it leaves, stops reading, or the store fails."""

    def __init__(
        self, store: Store, publisher: Publisher, measures: Measures, send_timeout_s: Callable[[], float]
    ) -> None:
        self._store, self._publisher, self._measures = store, publisher, measures
        self._send_timeout_s = send_timeout_s
        self._subscribers = 0
        self._count(0)

    async def serve(self, websocket: WebSocket) -> None:
        """Accept, and send every revision of `?kinds=` after `?after=`: first those in the store, then each new one."""
        live_from = self._publisher.last_seq
        await websocket.accept()
        try:
            after, kinds = websocket.query_params.get("after"), kinds_of(websocket.query_params.get("kinds"))
            seq = live_from if after is None else await self._position(after)
            await send_while_read(websocket, self._send_lines(websocket, seq, kinds), self._count, self._measures)
        except RefusedError as refusal:
            await self._close(websocket, refusal.code, refusal.reason)
        except StreamEndedError:
            await self._close(websocket, POSITION_LOST, "the numbers begin anew; get /advisories afresh")
        except StoreError:
            await self._close(websocket, STORE_FAILED, "the stored advisories can't be read; see /healthz")

    async def _position(self, after: str) -> int:
        if not (after.isascii() and after.isdigit() and len(after) <= MOST_DIGITS):
            raise RefusedError(BAD_AFTER, "after must be a whole number, 0 or more: the last seq that you have seen")
        seq = int(after)
        last = await asyncio.to_thread(self._store.last_seq)
        if seq > last:
            raise RefusedError(POSITION_LOST, f"after is beyond the last seq {last}; get /advisories afresh")
        return seq

    async def _send_lines(self, websocket: WebSocket, seq: int, kinds: Set[str]) -> None:
        removed_before = 0
        while True:
            page = await self._publisher.after(seq, kinds)
            if seq == 0:
                removed_before = page.removed  # a new subscriber holds nothing of it
            if page.removed > max(seq, removed_before):
                raise RefusedError(POSITION_LOST, f"some revisions after {seq} were removed; get /advisories afresh")
            for line in page.lines:
                async with asyncio.timeout(self._send_timeout_s()):
                    await websocket.send_text(line.text)
            seq = page.last
            await asyncio.sleep(0)  # let others run while this subscriber catches up

    async def _close(self, websocket: WebSocket, code: int, reason: str) -> None:
        with suppress(TimeoutError, WebSocketDisconnect):
            async with asyncio.timeout(self._send_timeout_s()):
                await websocket.close(code, reason)

    def _count(self, change: int) -> None:
        self._subscribers += change
        self._measures.level("deconflict_stream_subscribers", {(): self._subscribers})


def kinds_of(choices: str | None) -> Set[str]:
    """The kinds that a subscriber asks for, separated by commas; every kind of advisory if it does not say."""
    if choices is None:
        return ADVISORY_KINDS
    names = choices.split(",")
    if wrong := [name for name in names if name not in EVERY_KIND | {"advisory"}]:
        expected = "situation, advice, advisory, or kinds of advisory, as conflict"
        raise RefusedError(BAD_KINDS, f"kinds: found {wrong[0]!a:.24}; expected {expected}")
    return chosen_kinds(names)


async def send_while_read(
    websocket: WebSocket,
    sending: Coroutine[Any, Any, None],
    count: Callable[[int], None],
    measures: Measures,
    hear: Callable[[str], None] = lambda _: None,
) -> None:
    """Send until the subscriber leaves or a send takes longer than the time limit. It counts as present meanwhile.

    `hear` is called with each text that the subscriber sends.
    """
    count(+1)
    try:
        await until_either(sending, _disconnected(websocket, hear))
    except TimeoutError:
        measures.count("deconflict_stream_dropped_total")
    except WebSocketDisconnect:
        pass
    finally:
        count(-1)


async def _disconnected(websocket: WebSocket, hear: Callable[[str], None]) -> None:
    """Wait until the subscriber disconnects."""
    while (message := await websocket.receive())["type"] != "websocket.disconnect":
        hear(message.get("text") or "")
