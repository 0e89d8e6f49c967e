"""Posts each revision to an address, in order, and retries until the receiver accepts it."""

import asyncio
import time
from collections.abc import Mapping
from contextlib import suppress

import httpx

from deconflict.operator.outlets.store_cursor import StoreCursor
from deconflict.operator.outlets.webhook_signatures import signed
from deconflict.operator.store.publisher import PublishedLine
from deconflict.settings.outlet_settings import Webhook
from deconflict_client.advisory import ADVISORY_KINDS
from ingest.security.tokens import renewed

MOST_ANSWER_BYTES = 1 << 16


class WebhookOutlet:
    """One webhook. The next revision waits until the receiver has accepted this one."""

    def __init__(self, settings: Webhook, cursor: StoreCursor, known: Mapping[str, str] | None = None) -> None:
        """`known` are the secrets in use, by source."""
        self._settings, self._cursor = settings, cursor
        self._secret = renewed(settings.secret, (known or {}).get(settings.secret, ""))
        """Empty while it has never been read: nothing is sent then."""
        self._is_to_connect_anew = False
        """Whether a connection has failed since the client was made."""

    @property
    def secrets(self) -> dict[str, str]:
        return {self._settings.secret: self._secret}

    def refresh(self) -> None:
        """Read the secret again."""
        self._secret = renewed(self._settings.secret, self._secret)

    async def run(self) -> None:
        """Send revisions until cancelled."""
        await self._cursor.begin()
        self._client = self._new_client()
        try:
            async for line in self._cursor.lines():
                await self._deliver(line)
                self._cursor.delivered(line)
        finally:
            await self._client.aclose()

    def _new_client(self) -> httpx.AsyncClient:
        return httpx.AsyncClient(timeout=self._settings.timeout_s)

    async def _deliver(self, line: PublishedLine) -> None:
        """Try until the receiver accepts it, after a failed connection with the authorities as their files are now."""
        wait_s, longest_s = self._settings.retry_s
        while problem := await self._post(line):
            self._cursor.failed(problem)
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, longest_s)
            if self._is_to_connect_anew:
                await self._client.aclose()
                with suppress(OSError):  # the files are being written
                    self._client, self._is_to_connect_anew = self._new_client(), False

    async def _post(self, line: PublishedLine) -> str:
        """Why the request failed; empty if it succeeded. Leaves out the address, which may hold a secret."""
        if not self._secret:
            return f"its secret can't be read; look at {self._settings.secret}"
        body, subject = line.text.encode(), "advisory" if line.kind in ADVISORY_KINDS else line.kind
        try:
            signature = signed(f"{subject}-{line.seq}", body, self._secret, time.time())
            headers = {"content-type": "application/json", **signature}
            async with (
                asyncio.timeout(self._settings.timeout_s),
                self._client.stream("POST", self._settings.url, content=body, headers=headers) as answer,
            ):
                await _read_some(answer)
        except (httpx.HTTPError, httpx.InvalidURL, TimeoutError, ValueError) as error:
            self._is_to_connect_anew = isinstance(error, httpx.TransportError)
            return self._explained(error)
        return "" if answer.is_success else f"it answered {answer.status_code}"

    def _explained(self, error: Exception) -> str:
        """The error for people, with host and port and without the rest of the address, which may hold a secret."""
        with suppress(httpx.InvalidURL, ValueError):
            url = httpx.URL(self._settings.url)
            place = f"{url.host}:{url.port or {'http': 80, 'https': 443}[url.scheme]}"
            if isinstance(error, TimeoutError | httpx.TimeoutException):
                return f"{place} did not answer within {self._settings.timeout_s:g} s"
            if isinstance(error, httpx.TransportError):
                return f"{place}: {error or type(error).__name__}"
        return f"{type(error).__name__}; look at its url and secret"  # ValueError: the secret is not base64


async def _read_some(answer: httpx.Response) -> None:
    """Read the body, so that the connection can be used again. Nobody needs it, so of a long one only the beginning."""
    read_bytes = 0
    async for part in answer.aiter_raw():
        read_bytes += len(part)
        if read_bytes > MOST_ANSWER_BYTES:
            return
