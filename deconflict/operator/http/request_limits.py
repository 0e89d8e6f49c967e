"""What holds for every request, whatever it asks for: a bounded body, an answer instead of an error, safe headers."""

from typing import Any

from fastapi import HTTPException, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST_BODY_BYTES = 64 * 1024
"""No route needs a longer body."""
TOO_LONG = f"a body has {MOST_BODY_BYTES} bytes at most"
SAFE_HEADERS = {"x-content-type-options": "nosniff", "content-security-policy": "default-src 'none'"}
"""Of every answer that has none of its own."""


class RequestLimitsMiddleware:
    """The outermost layer: refuses long bodies before anybody reads them."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
        elif _announced_bytes(Headers(scope=scope)) > MOST_BODY_BYTES:
            await JSONResponse({"detail": TOO_LONG}, 413, {"connection": "close"})(scope, receive, _safe(send))
        else:
            await self._app(scope, _limited(receive), _safe(send))


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


async def invalid_request(_: Request, error: Exception) -> JSONResponse:
    """The answer to a request that does not validate. It repeats no input: JSON has no word for some of it."""
    problems = error.errors() if isinstance(error, RequestValidationError) else ()
    detail = [
        {"type": each["type"], "loc": [_written(part) for part in each["loc"]], "msg": _written(each["msg"])}
        for each in problems
    ]
    return JSONResponse({"detail": detail}, 422)


def _written(value: Any) -> Any:
    """Text that can be encoded."""
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else value
