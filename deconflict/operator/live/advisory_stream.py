"""The advisory stream: one WebSocket, which follows the store from a given position (`docs/api.md`)."""

import asyncio
from collections.abc import Callable
from contextlib import suppress

from fastapi import WebSocket, WebSocketDisconnect

from deconflict.operator.store.publisher import Publisher, StreamEndedError
from deconflict.operator.store.store import Store, StoreError
from deconflict.runtime.first_of import until_either
from ingest.measures.measures import Measures

BAD_AFTER = 4400
"""Close code: `after` is no whole number, 0 or more."""
AFTER_BEYOND_LAST = 4416
"""Close code: `after` is a number that this store has not given yet."""
STORE_FAILED = 1011
"""Close code: the stored advisories can't be read."""


MOST_DIGITS = 18
"""Of `after`: what the store can count to."""


class RefusedError(Exception):
    """The stream can't start where the subscriber asks."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


class Stream:
    """Serves subscribers, each until it leaves, is stuck, or the store fails."""

    def __init__(
        self, store: Store, publisher: Publisher, measures: Measures, send_timeout_s: Callable[[], float]
    ) -> None:
        self._store, self._publisher, self._measures = store, publisher, measures
        self._send_timeout_s = send_timeout_s
        self._subscribers = 0
        self._count(0)

    async def serve(self, websocket: WebSocket) -> None:
        """Accept and send every revision after `?after=`, first from the store, then as it is published."""
        live_from = self._publisher.last_seq
        await websocket.accept()
        self._count(+1)
        try:
            asked = websocket.query_params.get("after")
            seq = live_from if asked is None else await self._position(asked)
            await until_either(self._feed(websocket, seq), left(websocket))
        except RefusedError as refusal:
            await self._close(websocket, refusal.code, refusal.reason)
        except StreamEndedError:
            await self._close(websocket, AFTER_BEYOND_LAST, "the numbers begin anew; get /advisories afresh")
        except StoreError:
            await self._close(websocket, STORE_FAILED, "the stored advisories can't be read; see /healthz")
        except TimeoutError:
            self._measures.count("deconflict_stream_dropped_total")
        except WebSocketDisconnect:
            pass
        finally:
            self._count(-1)

    async def _position(self, asked: str) -> int:
        if not (asked.isascii() and asked.isdigit() and len(asked) <= MOST_DIGITS):
            raise RefusedError(BAD_AFTER, "after must be a whole number, 0 or more: the seq you have seen last")
        seq = int(asked)
        last = await asyncio.to_thread(self._store.last_seq)
        if seq > last:
            raise RefusedError(AFTER_BEYOND_LAST, f"after is beyond the last seq {last}; get /advisories afresh")
        return seq

    async def _feed(self, websocket: WebSocket, seq: int) -> None:
        while True:
            for line in await self._publisher.after(seq):
                async with asyncio.timeout(self._send_timeout_s()):
                    await websocket.send_text(line.text)
                seq = line.seq
            await asyncio.sleep(0)  # a subscriber that catches up lets the others have their turn

    async def _close(self, websocket: WebSocket, code: int, reason: str) -> None:
        with suppress(TimeoutError, WebSocketDisconnect):
            async with asyncio.timeout(self._send_timeout_s()):
                await websocket.close(code, reason)

    def _count(self, change: int) -> None:
        self._subscribers += change
        self._measures.level("deconflict_stream_subscribers", {(): self._subscribers})


async def left(websocket: WebSocket) -> None:
    """Returns when the subscriber has gone; what it says is not listened to."""
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass
