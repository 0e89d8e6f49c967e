"""What a subscriber at one face receives, and which meetings it was warned of."""

import asyncio
import json
import ssl
import time
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from deconflict_client.situations import POSITION_LOST

AHEAD_S, NEAR_S = 2.0, 4.0
"""A meeting is warned of if this long before the newest revision of its pair is open and predicts it so near."""
RETRY_S, LOOK_S = 0.2, 1.0
BY_FACE = ("seq", "situation_id")
"""What differs if a face that no NATS server was connected to gets the revision from the stream later."""


@dataclass(frozen=True, slots=True)
class Received:
    at_s: float
    id: str
    is_open: bool
    predicted_s: float


class WatchedFace:
    """Follows the stream and health of one face until it is cancelled."""

    def __init__(self, address: str, token: str, ca: str) -> None:
        self._address, self._headers = address, {"Authorization": f"Bearer {token}"}
        self._trusted = ssl.create_default_context(cafile=ca)
        self._of_pair: dict[tuple[str, ...], list[Received]] = defaultdict(list)
        self._seen: dict[tuple[str, int], str] = {}
        self._after: int | None = None
        self.doubled: list[str] = []
        """Revisions that came twice with another content."""
        self.lost_positions = 0
        """How often it was told to read again what is open."""
        self.health: list[tuple[float, str]] = []
        """When it was looked at, and its status; or "-" if it did not answer."""

    async def run(self) -> None:
        await asyncio.gather(self._follow(), self._look())

    async def stored(self) -> dict[str, Any]:
        """The newest revision of each advisory by id, as the face has stored it."""
        async with self._http() as client:
            answer = (await client.get("/advisories", params={"state": "all", "limit": 1000})).json()
        return {each["id"]: (each["revision"], each["seq"], each["state"]) for each in answer["advisories"]}

    async def is_whole(self) -> bool:
        """Whether the roles of all kinds answer."""
        with suppress(httpx.HTTPError, ValueError):
            async with self._http() as client:
                roles = (await client.get("/healthz")).json()["roles"]
            return all(state == "up" for state in roles.values())
        return False

    def warned_s(self, uuids: Sequence[str], meeting_s: float) -> float | None:
        """How long before a meeting a prediction of it came that stood until the meeting; None if none did."""
        since_s = None
        for received in self._of_pair[tuple(uuids)]:
            if received.at_s > meeting_s:
                break
            predicts = received.is_open and abs(received.predicted_s - meeting_s) <= NEAR_S
            since_s = (since_s or received.at_s) if predicts else None
        return None if since_s is None else meeting_s - since_s

    def ids(self, uuids: Sequence[str], meeting_s: float) -> set[str]:
        """The advisories that ever predicted a meeting."""
        of_pair = self._of_pair[tuple(uuids)]
        return {each.id for each in of_pair if each.is_open and abs(each.predicted_s - meeting_s) <= NEAR_S}

    async def _follow(self) -> None:
        while True:
            position = "" if self._after is None else f"&after={self._after}"
            url = f"wss://{self._address}/advisories/stream?kinds=advisory,situation{position}"
            try:
                async with connect(url, ssl=self._trusted, additional_headers=self._headers, proxy=None) as stream:
                    async for message in stream:
                        self._take(json.loads(message))
            except ConnectionClosed as closed:
                if closed.rcvd and closed.rcvd.code == POSITION_LOST:
                    self.lost_positions, self._after = self.lost_positions + 1, None
            except (OSError, WebSocketException, TimeoutError):
                pass
            await asyncio.sleep(RETRY_S)

    def _take(self, revision: dict[str, Any]) -> None:
        self._after = revision["seq"]
        key = revision["id"], revision["revision"]
        content = json.dumps({name: value for name, value in revision.items() if name not in BY_FACE}, sort_keys=True)
        if self._seen.setdefault(key, content) != content:
            self.doubled.append("{} {}".format(*key))
        if revision["kind"] != "conflict":
            return
        predicted_s = datetime.fromisoformat(revision["predicted_at"]).timestamp()
        received = Received(time.time(), revision["id"], revision["state"] != "cleared", predicted_s)
        self._of_pair[tuple(sorted(revision["robots"]))].append(received)

    async def _look(self) -> None:
        async with self._http() as client:
            while True:
                status = "-"
                with suppress(httpx.HTTPError, ValueError, KeyError):
                    status = (await client.get("/healthz")).json()["status"]
                self.health.append((time.time(), status))
                await asyncio.sleep(LOOK_S)

    def _http(self) -> httpx.AsyncClient:
        base = f"https://{self._address}"
        return httpx.AsyncClient(
            base_url=base, headers=self._headers, verify=self._trusted, timeout=3.0, trust_env=False
        )
