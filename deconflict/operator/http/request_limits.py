"""What holds for every request: a share by address or person, a bounded body, plain cookies, known parameters,
safe headers, no error."""

import asyncio
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import Any, cast

from fastapi import HTTPException, Request
from fastapi.exception_handlers import http_exception_handler
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from fastapi.routing import APIRoute
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from deconflict.operator.http.server.server_protocols import Places, count_refused
from ingest.languages.visible_text import visible

MOST_BODY_BYTES = 64 * 1024
"""No route needs a longer body."""
REQUEST_S, BYTES_PER_S = 0.02, 5e6
"""What a request costs of its sender's time, and how many bytes of an answer cost a second."""
BURST_S, MOST_WAIT_S = 2.0, 4.0
"""How much may be asked for at once, and how long a request waits at most; then it is refused."""
LONGEST_DEBT_S = BURST_S + 2 * MOST_WAIT_S
"""An address that has sent a flood is served at once again after this time."""
MOST_SENDERS = 10_000
MOST_LETTERS = 100
"""So much of an address is repeated."""
TOO_MANY = "too many requests from this address or person at once; ask less often"
TOO_LONG = f"a body has {MOST_BODY_BYTES} bytes at most"
SAFE_HEADERS = {"x-content-type-options": "nosniff", "content-security-policy": "default-src 'none'"}
"""Of every answer that has none of its own."""


class RequestShares:
    """Lets the requests of each sender wait their turn, so that they leave time for those of others."""

    def __init__(self) -> None:
        self._spent_until_s: OrderedDict[str, float] = OrderedDict()
        """By sender, until when its requests so far take up its time; the one heard longest ago first."""

    def wait_s(self, sender: str, now_s: float) -> float:
        """Note a request. Returns how long it should wait."""
        return max(self.charge(sender, REQUEST_S, now_s) - now_s - BURST_S, 0.0)

    def charge(self, sender: str, cost_s: float, now_s: float) -> float:
        """Add to what a sender has spent. Returns until when that takes up its time."""
        until_s = self._spent_until_s.pop(sender, now_s)
        until_s = min(max(until_s, now_s) + cost_s, now_s + LONGEST_DEBT_S)
        self._spent_until_s[sender] = until_s
        if len(self._spent_until_s) > MOST_SENDERS:
            self._spent_until_s.popitem(last=False)
        return until_s


class RequestLimitsMiddleware:
    """The outermost layer: lets floods wait, and refuses long bodies before anybody reads them."""

    def __init__(self, app: ASGIApp, places: Places) -> None:
        self._app, self._places, self._shares = app, places, RequestShares()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        scope["headers"] = _without_quotes(scope["headers"])
        sender, loop = self._places.holder(scope.get("client")), asyncio.get_running_loop()
        wait_s = self._shares.wait_s(sender, loop.time())
        await asyncio.sleep(min(wait_s, MOST_WAIT_S))
        send = self._charged(send, sender)
        if wait_s > MOST_WAIT_S:
            count_refused(scope["app"].state, "face-too-many")
            headers = {"connection": "close", "retry-after": f"{LONGEST_DEBT_S:.0f}"}
            refusal = JSONResponse({"detail": TOO_MANY}, 429, headers)
            await refusal(scope, receive, _safe(send))
        elif scope["type"] == "websocket":
            await self._app(scope, receive, send)
        elif _announced_bytes(Headers(scope=scope)) > MOST_BODY_BYTES:
            await JSONResponse({"detail": TOO_LONG}, 413, {"connection": "close"})(scope, receive, _safe(send))
        else:
            await self._app(scope, _limited(receive), _safe(send))

    def _charged(self, send: Send, sender: str) -> Send:
        """A `send` that charges a sender for the bytes of its answers. What a subscriber gets is not asked for."""

        async def charged(message: Message) -> None:
            if message["type"] == "http.response.body":
                cost_s = len(message.get("body", b"")) / BYTES_PER_S
                self._shares.charge(sender, cost_s, asyncio.get_running_loop().time())
            await send(message)

        return charged


def _without_quotes(headers: Iterable[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    """The headers without quoted cookies, which are not ours: `http.cookies` takes seconds for quoted backslashes."""
    return [(name, _plain_cookies(value) if name == b"cookie" else value) for name, value in headers]


def _plain_cookies(header: bytes) -> bytes:
    return b";".join(pair for pair in header.split(b";") if b'"' not in pair and b"\\" not in pair)


def _safe(send: Send) -> Send:
    """A `send` that adds safe headers."""

    async def safe(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in SAFE_HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return safe


def _announced_bytes(headers: Headers) -> int:
    length = headers.get("content-length", "")
    return int(length) if length.isascii() and length.isdigit() else 0


def _limited(receive: Receive) -> Receive:
    """A `receive` that raises an `HTTPException` once the body is too long."""
    received_bytes = 0

    async def limited() -> Message:
        nonlocal received_bytes
        message = await receive()
        received_bytes += len(message.get("body", b""))
        if received_bytes > MOST_BODY_BYTES:
            raise HTTPException(413, TOO_LONG)
        return message

    return limited


async def refuse_unknown_parameters(connection: HTTPConnection) -> None:
    """Refuse a parameter that the route does not have. If it were ignored, all would pass for what was asked for."""
    route = connection.scope.get("route")
    if not isinstance(route, APIRoute) or not route.include_in_schema:
        return
    known = [field.alias for field in route.dependant.query_params]
    for name in connection.query_params:
        if name not in known:
            expected = f"expected {', '.join(known)}" if known else "it has none"
            raise HTTPException(422, f"{_written(name)}: is no parameter of {route.path}; {expected}")


async def invalid_request(_: Request, error: Exception) -> JSONResponse:
    """The answer to a request that does not validate. It repeats no input, which may be long."""
    problems = error.errors() if isinstance(error, RequestValidationError) else ()
    return JSONResponse({"detail": _written("; ".join(map(_problem_text, problems)))}, 422)


def _problem_text(problem: Mapping[str, Any]) -> str:
    """Where it is, and what was expected. The place is the parameter or the path in the body."""
    path = problem["loc"][1:]
    if problem["type"] == "json_invalid":
        why = problem.get("ctx", {}).get("error", problem["msg"])
        return f"body: is no JSON at character {int(path[0]) + 1}: {why}" if path else f"body: is no JSON: {why}"
    return f"{'.'.join(map(str, path)) or 'body'}: {problem['msg']}"


async def unknown_address(request: Request, error: Exception) -> Response:
    """The answer to a refusal of a route, and to an address or method that none has: it names what was asked for."""
    refusal = cast(HTTPException, error)
    asked, allowed = visible(_written(request.url.path[:MOST_LETTERS])), (refusal.headers or {}).get("Allow")
    if refusal.status_code == HTTPStatus.NOT_FOUND and refusal.detail == HTTPStatus.NOT_FOUND.phrase:
        detail = f"there is no {asked}; GET /openapi.json lists all addresses"
    elif refusal.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        detail = f"{asked} can't be asked by {request.method}" + (f"; expected {allowed}" if allowed else "")
    else:
        return await http_exception_handler(request, refusal)
    return JSONResponse({"detail": detail}, refusal.status_code, headers=refusal.headers)


def _written(text: str) -> str:
    """Text that can be encoded."""
    return text.encode("utf-8", "replace").decode()
