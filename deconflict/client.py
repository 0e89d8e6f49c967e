"""A client for services of the site: read what is open, follow every revision without a gap, acknowledge.

async with Client("http://127.0.0.1:8080", token=token) as client:
    async for advisory in client.follow(after=last_seen):
        ...
        last_seen = advisory.seq
"""

import asyncio
import ssl
from collections.abc import AsyncGenerator, AsyncIterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException

from deconflict.advisory import ADVISORY, AnyAdvisory
from deconflict.operator.live.advisory_stream import AFTER_BEYOND_LAST
from deconflict.operator.store.store import Listing
from deconflict.operator.vendor_health import VendorHealth, VendorList

MOST_LISTED = 1000
BACKOFF_S = (0.2, 10.0)
"""First and longest wait before a lost stream is sought again."""
CLOSED_BY_POLICY = 1008


class ClientError(Exception):
    """The service said no; the message says why."""


class NotAllowedError(ClientError):
    """The token is missing, wrong, or for a lesser role."""


class UntrustedError(ClientError):
    """What answers has no certificate of the authority, or not for its name."""


class NoSuchAdvisoryError(ClientError):
    """The advisory is not stored, or no longer."""


class PositionLostError(ClientError):
    """The store does not reach as far as the number given: it is another one. Read what is open afresh."""


class Client:
    """Talks to one service. Use it as `async with`."""

    def __init__(
        self,
        url: str,
        *,
        token: str | None = None,
        authority: Path | None = None,
        backoff_s: tuple[float, float] = BACKOFF_S,
    ) -> None:
        """`url` is the operators' port, such as `https://floor.example:8080`; `token` a person's of the site file.

        `authority` is a PEM file of who signed the certificate of an `https` port; those of the system if absent.
        Raises `OSError` where that file can't be read.
        """
        self._headers = {"authorization": f"Bearer {token}"} if token else {}
        self._tls = ssl.create_default_context(cafile=authority) if url.startswith("https:") else None
        self._http = httpx.AsyncClient(base_url=url, headers=self._headers, verify=self._tls or True)
        self._stream = "ws" + url.removeprefix("http").rstrip("/") + "/advisories/stream"
        self._backoff_s = backoff_s

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._http.aclose()

    async def open(self) -> Listing:
        """What is open, newest first, and the place in the stream: `follow(after=listing.seq)` goes on from it.

        Raises `ClientError`, and `httpx.HTTPError` where the service can't be reached.
        """
        told = _answer(await self._http.get("/advisories", params={"limit": MOST_LISTED}))
        advisories = [ADVISORY.validate_python(one) for one in told["advisories"]]
        return Listing(seq=told["seq"], advisories=advisories, more=told["more"])

    async def revisions(self, advisory_id: str) -> list[AnyAdvisory]:
        """Every revision of one advisory, the newest last.

        Raises `ClientError`, and `httpx.HTTPError` where the service can't be reached.
        """
        told = _answer(await self._http.get(f"/advisories/{advisory_id}"))
        return [ADVISORY.validate_python(one) for one in told["advisories"]]

    async def vendors(self) -> list[VendorHealth]:
        """How each vendor does, by name.

        Raises `ClientError`, and `httpx.HTTPError` where the service can't be reached.
        """
        return VendorList.model_validate(_answer(await self._http.get("/vendors"))).vendors

    async def acknowledge(self, advisory_id: str, *, name: str, reason: str) -> AnyAdvisory:
        """Take an advisory up; everybody sees by whom and why. With a token the name is the token's.

        Raises `ClientError`, and `httpx.HTTPError` where the service can't be reached.
        """
        path = f"/advisories/{advisory_id}/acknowledgement"
        return ADVISORY.validate_python(_answer(await self._http.post(path, json={"name": name, "reason": reason})))

    async def follow(self, after: int) -> AsyncGenerator[AnyAdvisory, None]:
        """Every revision with a number above `after`, each once and in order, for ever.

        A stream that is lost is sought again and resumed. Raises `PositionLostError`, `NotAllowedError` and
        `UntrustedError`.
        """
        wait_s = self._backoff_s[0]
        while True:
            try:
                async with connect(
                    f"{self._stream}?after={after}", additional_headers=self._headers, proxy=None, ssl=self._tls
                ) as stream:
                    async for advisory in _revisions(stream):
                        yield advisory
                        after, wait_s = advisory.seq, self._backoff_s[0]
            except InvalidStatus as error:
                if error.response.status_code in (401, 403):
                    raise NotAllowedError(f"{self._stream} answered {error.response.status_code}") from error
            except ssl.SSLCertVerificationError as error:
                raise UntrustedError(f"{self._stream}: {error.verify_message}") from error
            except (OSError, WebSocketException):
                pass
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, self._backoff_s[1])


async def _revisions(stream: ClientConnection) -> AsyncIterator[AnyAdvisory]:
    """Until the connection ends, however it ends."""
    try:
        while True:
            yield ADVISORY.validate_json(await stream.recv())
    except ConnectionClosed as closed:
        code, reason = (closed.rcvd.code, closed.rcvd.reason) if closed.rcvd else (None, "")
        if code == AFTER_BEYOND_LAST:
            raise PositionLostError(reason) from closed
        if code == CLOSED_BY_POLICY:
            raise NotAllowedError(reason) from closed


def _answer(response: httpx.Response) -> Any:
    if response.is_success:
        return response.json()
    try:
        why = str(response.json()["detail"])
    except (ValueError, KeyError, TypeError):
        why = response.text
    kinds = {401: NotAllowedError, 403: NotAllowedError, 404: NoSuchAdvisoryError}
    raise kinds.get(response.status_code, ClientError)(f"{response.status_code}: {why}")
