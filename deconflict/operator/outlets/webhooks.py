"""Posting each revision to an address, in order, again and again until it is taken."""

import asyncio
import time

import httpx

from deconflict.operator.outlets.store_cursor import Following
from deconflict.operator.outlets.webhook_signatures import signed
from deconflict.operator.store.publisher import Line
from deconflict.settings.outlet_settings import Webhook
from ingest.security.tokens import renewed, secret


class Poster:
    """One webhook. Nothing overtakes a revision that is not taken."""

    def __init__(self, settings: Webhook, following: Following) -> None:
        """Raises `SecretError` where the secret can't be had."""
        self._settings, self._following = settings, following
        self._secret = secret(settings.secret)

    def refresh(self) -> None:
        """Read the secret again."""
        self._secret = renewed(self._settings.secret, self._secret)

    async def run(self) -> None:
        """Until cancelled."""
        await self._following.begin()
        async with httpx.AsyncClient(timeout=self._settings.timeout_s) as client:
            async for line in self._following.lines():
                await self._until_taken(client, line)
                self._following.taken(line)

    async def _until_taken(self, client: httpx.AsyncClient, line: Line) -> None:
        wait_s, longest_s = self._settings.retry_s
        while why := await self._refused(client, line):
            self._following.failed(why)
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, longest_s)

    async def _refused(self, client: httpx.AsyncClient, line: Line) -> str:
        """Why a request was not taken; empty where it was. The address is not told: it may hold a secret."""
        body = line.text.encode()
        try:
            signature = signed(f"advisory-{line.seq}", body, self._secret, time.time())
            headers = {"content-type": "application/json", **signature}
            answer = await client.post(self._settings.url, content=body, headers=headers)
        except (httpx.HTTPError, httpx.InvalidURL, ValueError) as error:  # the last of a secret that is no base64
            return type(error).__name__
        return "" if answer.is_success else f"answered {answer.status_code}"
