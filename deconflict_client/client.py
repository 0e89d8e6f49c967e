"""A client for other services of the site: reads what is open, follows every revision, acknowledges, answers advice.

async with Client("http://127.0.0.1:8080", token=token) as client:
    async for advisory in client.follow(after=last_seen):
        ...
        last_seen = advisory.seq
"""

import asyncio
import json
import ssl
from collections.abc import AsyncGenerator, AsyncIterator, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self, overload
from urllib.parse import urlencode

import httpx
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException

from deconflict_client.advisory import ADVISORY, AdviceAnswer, AnyAdvisory, KindChoice
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.answers.api_models import AdviceList
from deconflict_client.answers.blackbox_models import BlackBoxList, KeptBlackBox
from deconflict_client.answers.health_models import ServiceHealth
from deconflict_client.answers.robot_models import HeardRobot, RobotList
from deconflict_client.answers.site_models import SiteMap
from deconflict_client.answers.suggestion_models import SuggestionList
from deconflict_client.answers.vendor_models import VendorHealth, VendorList
from deconflict_client.situations import (
    BAD_KINDS,
    POSITION_LOST,
    REVISION,
    AnyRevision,
    Listing,
    Situation,
)

MOST_LISTED = 10_000
BACKOFF_S = (0.2, 10.0)
"""First and longest wait before a lost stream is opened again."""
CLOSED_BY_POLICY = 1008
DEGRADED = 503
"""Status of the health of a service that is degraded."""


class ClientError(Exception):
    """The service refused the request; the message says why."""


class NotAllowedError(ClientError):
    """The token is missing or wrong, or its role is too low."""


class UntrustedError(ClientError):
    """The server has no certificate of the authority for its name."""


class NoSuchAdvisoryError(ClientError):
    """What was asked for by its id or name is not known, or has been removed."""


class PositionLostError(ClientError):
    """Not all that follows the given number is stored. Read what is open again, and drop what is not in it.

    It was removed while nobody followed the stream, or the number is beyond the store's last: it is another store.
    """


@dataclass(frozen=True, slots=True)
class AdviceListing:
    """What is asked of robots, and the position in the stream at that moment."""

    seq: int
    """The newest number in the store."""
    advice: list[RobotAdvice]
    """The newest revision of each, newest first."""
    more: bool
    """Whether the limit left some out."""
    unknown: dict[str, str] = field(default_factory=dict)
    """By parameter of the filter whose name nobody known has, a sentence on it."""


@dataclass(frozen=True, slots=True)
class SituationListing:
    """Some situations, and the position in the stream at that moment."""

    seq: int
    """The newest number in the store."""
    situations: list[Situation]
    """The newest revision of each, newest first."""
    more: bool
    """Whether the limit left some out."""


class Client:
    """A connection to one service. Use it with `async with`."""

    def __init__(
        self,
        url: str,
        *,
        token: str | None = None,
        authority: Path | None = None,
        backoff_s: tuple[float, float] = BACKOFF_S,
    ) -> None:
        """`url` is the operators' port, such as `https://floor.example:8080`. `token` is a token of the site file.

        `authority` is a PEM file with the authority of an `https` port's certificate; None for the system's.
        Raises `OSError` if that file can't be read.
        """
        if authority and not authority.is_file():
            raise FileNotFoundError(f"{authority} is no file")  # a pipe would be waited for
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

    async def open(self) -> Listing[AnyAdvisory]:
        """The open advisories, newest first, and the stream's position: `follow(after=listing.seq)` continues there.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        answer = _json(await self._http.get("/advisories", params={"limit": MOST_LISTED}))
        advisories = [ADVISORY.validate_python(advisory) for advisory in answer["advisories"]]
        return Listing(seq=answer["seq"], advisories=advisories, more=answer["more"])

    async def situations(self) -> SituationListing:
        """The open situations, newest first, and the stream's position, as `open` gives advisories.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        answer = _json(await self._http.get("/situations", params={"limit": MOST_LISTED}))
        situations = [Situation.model_validate(situation) for situation in answer["situations"]]
        return SituationListing(seq=answer["seq"], situations=situations, more=answer["more"])

    async def advice(
        self, vendor: str | None = None, *, robot: str | None = None, state: Literal["open", "cleared", "all"] = "open"
    ) -> AdviceListing:
        """What is asked of the robots of a vendor, of one robot (UUID), or of all, newest first, and the stream's
        position: follow `kinds=["advice"]` from there.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        parameters = {"limit": str(MOST_LISTED), "state": state} | _given(vendor) | ({"robot": robot} if robot else {})
        found = AdviceList.model_validate(_json(await self._http.get("/advice", params=parameters)))
        asked = [
            each
            for each in found.advice
            if vendor in (None, each.vendor) and (robot is None or robot.lower() == each.robot)
        ]
        return AdviceListing(seq=found.seq, advice=asked, more=found.more, unknown=found.unknown)

    async def answer(self, advice_id: str, answer: AdviceAnswer, *, why: str = "", name: str = "") -> RobotAdvice:
        """Answer advice for a robot: accepted, declined and why, or done.

        With a token, the name is that of its person. Raises `ClientError`, also if the advice has ended, has
        another answer or was asked of another vendor, and `httpx.HTTPError` if the service can't be reached.
        """
        body = {"answer": answer, "why": why, "name": name}
        return RobotAdvice.model_validate(_json(await self._http.post(f"/advice/{advice_id}/answer", json=body)))

    async def revisions(self, advisory_id: str) -> list[AnyRevision]:
        """Every revision of one advisory or situation, the newest last.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        answer = _json(await self._http.get(f"/advisories/{advisory_id}"))
        return [REVISION.validate_python(advisory) for advisory in answer["advisories"]]

    async def vendors(self) -> list[VendorHealth]:
        """The state of each vendor, by name.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        return VendorList.model_validate(_json(await self._http.get("/vendors"))).vendors

    async def robots(self, vendor: str | None = None) -> RobotList:
        """The robots of a vendor, or all, and whether nobody known has that name (`unknown`).

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        return RobotList.model_validate(_json(await self._http.get("/robots", params=_given(vendor))))

    async def robot(self, uuid: str) -> HeardRobot:
        """One robot.

        Raises `NoSuchAdvisoryError` if it has not reported, `ClientError`, and `httpx.HTTPError` if the service can't
        be reached.
        """
        return HeardRobot.model_validate(_json(await self._http.get(f"/robots/{uuid}")))

    async def site(self) -> SiteMap:
        """The floors, and what lies on them.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        return SiteMap.model_validate(_json(await self._http.get("/site")))

    async def health(self) -> ServiceHealth:
        """The state of the service and of its parts, also while it is degraded.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        answer = await self._http.get("/healthz")
        return ServiceHealth.model_validate(answer.json() if answer.status_code == DEGRADED else _json(answer))

    async def blackboxes(self) -> list[KeptBlackBox]:
        """The black boxes that are kept, newest last.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        return BlackBoxList.model_validate(_json(await self._http.get("/blackboxes"))).blackboxes

    async def suggestions(self) -> SuggestionList:
        """The places where most time is lost, with why and what pays, and what to change on the floor.

        Raises `ClientError`, and `httpx.HTTPError` if the service can't be reached.
        """
        return SuggestionList.model_validate(_json(await self._http.get("/suggestions")))

    async def acknowledge(self, advisory_id: str, *, name: str, reason: str) -> AnyRevision:
        """Acknowledge an advisory or a situation; everybody sees by whom and why.

        With a token, the name is that of its person. Raises `ClientError`, and `httpx.HTTPError` if the service
        can't be reached.
        """
        path = f"/advisories/{advisory_id}/acknowledgement"
        return REVISION.validate_python(_json(await self._http.post(path, json={"name": name, "reason": reason})))

    @overload
    def follow(self, after: int) -> AsyncGenerator[AnyAdvisory, None]: ...

    @overload
    def follow(self, after: int, kinds: Iterable[KindChoice]) -> AsyncGenerator[AnyRevision, None]: ...

    async def follow(
        self, after: int, kinds: Iterable[KindChoice] = ("advisory",)
    ) -> AsyncGenerator[AnyRevision, None]:
        """Every revision of these kinds with a number above `after`, each once and in order, without end.

        Numbers ascend. Those of other kinds are left out. Reconnects and resumes if the connection is lost. Raises
        `PositionLostError`, `NotAllowedError`, `UntrustedError`, and `ClientError` for unknown kinds.
        """
        wait_s, asked = self._backoff_s[0], ",".join(kinds)
        while True:
            address = f"{self._stream}?{urlencode({'after': after, 'kinds': asked}, safe=',')}"
            try:
                async with connect(address, additional_headers=self._headers, proxy=None, ssl=self._tls) as stream:
                    async for advisory in _revisions(stream):
                        yield advisory
                        after, wait_s = advisory.seq, self._backoff_s[0]
            except InvalidStatus as error:
                if error.response.status_code in (401, 403):
                    raise NotAllowedError(_refusal(error.response.status_code, error.response.body)) from error
            except ssl.SSLCertVerificationError as error:
                raise UntrustedError(f"{self._stream}: {error.verify_message}") from error
            except (OSError, WebSocketException):
                pass
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, self._backoff_s[1])


async def _revisions(stream: ClientConnection) -> AsyncIterator[AnyRevision]:
    """The revisions until the connection ends. Raises `ClientError`."""
    try:
        while True:
            yield REVISION.validate_json(await stream.recv())
    except ConnectionClosed as closed:
        code, reason = (closed.rcvd.code, closed.rcvd.reason) if closed.rcvd else (None, "")
        if code == POSITION_LOST:
            raise PositionLostError(reason) from closed
        if code == CLOSED_BY_POLICY:
            raise NotAllowedError(reason) from closed
        if code == BAD_KINDS:
            raise ClientError(reason) from closed


def _given(vendor: str | None) -> dict[str, str]:
    """The parameter of a filter, if there is one."""
    return {} if vendor is None else {"vendor": vendor}


def _json(response: httpx.Response) -> Any:
    if response.is_success:
        return response.json()
    kinds = {401: NotAllowedError, 403: NotAllowedError, 404: NoSuchAdvisoryError}
    raise kinds.get(response.status_code, ClientError)(_refusal(response.status_code, response.content))


def _refusal(status: int, body: bytes | bytearray) -> str:
    """The status and the reason that the answer gives."""
    try:
        reason = str(json.loads(body)["detail"])
    except (ValueError, KeyError, TypeError):
        reason = body.decode("utf-8", "replace")
    return f"{status}: {reason}"
