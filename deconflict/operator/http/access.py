"""Who may use the operators' port, and for what. Without any person in the site file everybody may.

A program sends its token as `Authorization: Bearer TOKEN`; a browser signs in once at `/login` and keeps a cookie.
"""

import secrets
from collections.abc import Iterable, Mapping
from html import escape
from http.cookies import CookieError, SimpleCookie
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from deconflict.settings.site import Operator, Person, Role, Site
from ingest.security.certificates import Certificates
from ingest.security.origin_check import host_of, is_fixed, is_loopback
from ingest.security.tokens import Tokens, secret
from ingest.security.vendor_credentials import VendorCredentials

RANK: Mapping[Role, int] = {"read": 0, "acknowledge": 1, "administer": 2}
COOKIE = "deconflict_session"
MOST_SESSIONS = 1000
MOST_FORM_BYTES = 4096


def needed(method: str, path: str) -> Role:
    """The role that a request takes."""
    if method in ("GET", "HEAD", "WEBSOCKET"):
        return "read"
    return "acknowledge" if path.startswith("/advisories/") else "administer"


def exposed(site: Site) -> list[str]:
    """Ports that listen beyond this machine though nobody needs credentials there, a sentence each."""
    told = []
    guarded = any(vendor.token or vendor.certificate_names for vendor in site.vendors)
    if not is_loopback(site.receiver.host) and not guarded:
        told.append(f"receiver.host: {site.receiver.host} is open to a network; give each vendor a token")
    if not is_loopback(site.operator.host) and not site.operator.people:
        told.append(f"operator.host: {site.operator.host} is open to a network; name operator.people with tokens")
    return told


def verify(site: Site) -> None:
    """Raises `SecretError` or `CertificateError` where something that the site file points at can't be used."""
    VendorCredentials(site.vendors)
    People(site.operator.people)
    for source in (*(one.secret for one in site.webhooks), *([site.mqtt.password] if site.mqtt else [])):
        if source:
            secret(source)
    for tls in (site.receiver.tls, site.operator.tls):
        if tls:
            Certificates(tls)


class Entered(NamedTuple):
    """Somebody who came in, and the digest of the token that let them in."""

    person: str
    digest: bytes | None


class People:
    """Who may use the port, by token, and each one's role."""

    def __init__(self, people: Iterable[Person]) -> None:
        """Raises `SecretError` where a token can't be had."""
        self.renew(people)

    def renew(self, people: Iterable[Person]) -> None:
        """Other people from now on. Raises `SecretError`; then it stays as it was."""
        people = tuple(people)
        self._tokens = Tokens({person.name: person.token for person in people})
        self._roles: dict[str, Role] = {person.name: person.role for person in people}

    def __bool__(self) -> bool:
        return bool(self._roles)

    def entered(self, authorization: str | None) -> Entered | None:
        """Who comes in by an `Authorization` header."""
        person = self._tokens.owner(authorization)
        return Entered(person, self._tokens.digest(person)) if person else None

    def role(self, entered: Entered) -> Role | None:
        """None for somebody who is no longer among them, or whose token has changed since."""
        if self._tokens.digest(entered.person) != entered.digest:
            return None
        return self._roles.get(entered.person)

    def refresh(self) -> None:
        """Read the tokens again."""
        self._tokens.refresh()


class Access:
    """Middleware: lets a request through with the person's name in its state, or answers it."""

    def __init__(self, app: ASGIApp, settings: Operator, people: People) -> None:
        self._app, self._people = app, people
        self._secure, self._is_local = settings.tls is not None, is_loopback(settings.host)
        self._sessions: dict[str, Entered] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        answer = await self._judge(scope, receive)
        if answer is None:
            await self._app(scope, receive, self._while_allowed(scope, send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": "not allowed"})
        else:
            await answer(scope, receive, send)

    async def _judge(self, scope: Scope, receive: Receive) -> Response | None:
        headers, path = Headers(scope=scope), scope["path"]
        method = "WEBSOCKET" if scope["type"] == "websocket" else scope["method"]
        if _foreign(headers):
            return _refused(403, "pages of other sites may not use this service")
        if not self._people:
            return self._unnamed(headers)
        if path == "/login":
            return await self._sign_in(Request(scope, receive)) if method == "POST" else _login_page("")
        person = self._people.entered(headers.get("authorization")) or self._of_session(headers)
        return None if path == "/healthz" else self._allow(person, scope, method, headers)

    def _unnamed(self, headers: Headers) -> Response | None:
        """Where everybody on this machine may, whoever asks for another name is led here from elsewhere."""
        host = host_of(headers.get("host", ""))
        if self._is_local and not is_fixed(host):
            return _refused(403, "ask for localhost or an address; to be asked for by a name, name operator.people")
        return None

    def _allow(self, entered: Entered | None, scope: Scope, method: str, headers: Headers) -> Response | None:
        person, role = (entered.person, self._people.role(entered)) if entered else ("", None)
        if entered is None or role is None:
            wants_page = method == "GET" and "text/html" in headers.get("accept", "")
            return _login_page("") if wants_page else _refused(401, "send 'Authorization: Bearer TOKEN', or sign in")
        wanted = needed(method, scope["path"])
        if RANK[role] < RANK[wanted]:
            return _refused(403, f"{person} may {role}; this takes the role {wanted}")
        scope.setdefault("state", {})["person"] = person
        scope["state"]["entered"] = entered
        return None

    def _while_allowed(self, scope: Scope, send: Send) -> Send:
        """What a WebSocket sends, until who opened it may no longer read."""
        if scope["type"] != "websocket":
            return send
        entered: Entered | None = scope.get("state", {}).get("entered")

        async def guarded(message: Message) -> None:
            gone = self._people and (entered is None or self._people.role(entered) is None)
            if gone and message["type"] == "websocket.send":
                await send({"type": "websocket.close", "code": 1008, "reason": "no longer allowed"})
                raise OSError  # which Starlette tells the application as a peer that has gone
            await send(message)

        return guarded

    async def _sign_in(self, request: Request) -> Response:
        body = b""
        async for chunk in request.stream():
            body += chunk
            if len(body) > MOST_FORM_BYTES:
                return _refused(413, "the form is too long")
        told = parse_qs(body.decode("utf-8", "replace")).get("token", [""])[0]
        entered = self._people.entered(f"Bearer {told}")
        if entered is None:
            return _login_page("That token is nobody's.")
        session = secrets.token_urlsafe(32)
        while len(self._sessions) >= MOST_SESSIONS:
            self._sessions.pop(next(iter(self._sessions)))
        self._sessions[session] = entered
        answer = RedirectResponse("/", 303)
        answer.set_cookie(COOKIE, session, httponly=True, secure=self._secure, samesite="strict", path="/")
        return answer

    def _of_session(self, headers: Headers) -> Entered | None:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return None
        return self._sessions.get(cookie.value) if cookie else None


def _foreign(headers: Headers) -> bool:
    """Whether a browser says that another site's page asks: it would act with the operator's rights."""
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc != headers.get("host")


def _refused(status: int, reason: str) -> Response:
    headers = {"www-authenticate": "Bearer"} if status == 401 else {}
    return JSONResponse({"detail": reason}, status, headers)


def _login_page(problem: str) -> Response:
    return HTMLResponse(
        f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>Sign in</title>
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<body style="font: 1rem system-ui; max-width: 24rem; margin: 15vh auto; padding: 0 1rem">
<h1>Sign in</h1><p role="alert">{escape(problem)}</p>
<form method="post" action="/login"><label>Your token<br>
<input name="token" type="password" autocomplete="current-password" required autofocus style="width: 100%"></label>
<p><button>Sign in</button></p></form></html>
""",
        401,
    )
