"""Access control of the operators' port. If the site file names no people, everybody has access.

A program sends its token as `Authorization: Bearer TOKEN`. A browser signs in once at `/login` and keeps a cookie.
"""

import asyncio
import secrets
from collections.abc import Callable, Iterable, Mapping
from html import escape
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import Operator, Person, Role, Site
from ingest.port.connection_shares import site_of
from ingest.security.certificates import client_context, server_context
from ingest.security.failed_sign_ins import FailedSignIns
from ingest.security.origin_check import host_of, is_fetched_elsewhere, is_fixed, is_loopback
from ingest.security.refused_clients import RefusedClients
from ingest.security.tokens import Tokens, secret_of, verify_tokens
from ingest.security.vendor_credentials import token_sources

RANK: Mapping[Role, int] = {"read": 0, "answer": 1, "acknowledge": 2, "administer": 3}
OFF_FLOOR = "/off-floor"
"""The end of the address at which somebody says that a robot is off the floor."""
COOKIE = "deconflict_session"
MOST_SESSIONS = 100
"""Of one person; then their oldest ends."""
MOST_FORM_BYTES = 4096


def role_needed(method: str, path: str) -> Role:
    """The role that a request needs."""
    if method in ("GET", "HEAD", "WEBSOCKET"):
        return "read"
    if path.startswith("/advice/"):
        return "answer"
    is_said_of_robot = path.startswith("/robots/") and path.endswith(OFF_FLOOR)
    return "acknowledge" if is_said_of_robot or path.startswith(("/advisories/", "/situations/")) else "administer"


def exposed_ports(site: Site) -> list[str]:
    """A sentence for each port that is open to a network and asks for no credentials."""
    problems = []
    guarded = any(vendor.token or vendor.certificate_names for vendor in site.vendors)
    if not is_loopback(site.receiver.host) and not guarded:
        problems.append(f"receiver.host: {site.receiver.host} is open to a network; give each vendor a token")
    if not is_loopback(site.operator.host) and not site.operator.people:
        problems.append(f"operator.host: {site.operator.host} is open to a network; name operator.people with tokens")
    return problems


def verify_credentials(site: Site) -> None:
    """Raises `SecretError` or `CertificateError` if a secret or certificate of the site file can't be used."""
    verify_tokens(token_sources(site.vendors))
    verify_tokens(_token_sources(site.operator.people))
    outlets = [(f"webhook {webhook.name}", webhook.secret) for webhook in site.webhooks]
    for name, source in (*outlets, ("mqtt", site.mqtt.password if site.mqtt else None)):
        if source:
            secret_of(name, source)
    for tls in (site.receiver.tls, site.operator.tls):
        if tls:
            server_context(tls)
    for connection in (*site.mqtt_sources, site.mqtt, site.cluster):
        if connection:
            client_context(connection.ca, connection.certificate if isinstance(connection, Cluster) else "")


def _token_sources(people: Iterable[Person]) -> dict[str, str]:
    return {person.name: person.token for person in people}


class SignIn(NamedTuple):
    """A person who has signed in."""

    person: str
    digest: bytes | None
    """Of the token that the person used."""


class People:
    """The people who may use the port, their tokens and their roles."""

    def __init__(self, people: Iterable[Person]) -> None:
        self._tokens = Tokens({})
        self.renew(people)

    def renew(self, people: Iterable[Person]) -> None:
        """Replace the people. Who stays with the same source of a token keeps it if it can't be read just now."""
        people = tuple(people)
        self._tokens = Tokens(_token_sources(people), self._tokens)
        self._roles: dict[str, Role] = {person.name: person.role for person in people}
        self._vendors = {person.name: person.vendor for person in people if person.vendor}

    def __bool__(self) -> bool:
        return bool(self._roles)

    def sign_in(self, authorization: str | None) -> SignIn | None:
        """The person of an `Authorization` header; None if its token is nobody's."""
        person = self._tokens.owner(authorization)
        return SignIn(person, self._tokens.digest(person)) if person else None

    def role(self, signed_in: SignIn) -> Role | None:
        """None if the person has been removed, or the token has changed since."""
        if self._tokens.digest(signed_in.person) != signed_in.digest:
            return None
        return self._roles.get(signed_in.person)

    def vendor(self, person: str) -> str | None:
        """The vendor for which alone a person answers advice; None if there is no such limit."""
        return self._vendors.get(person)

    def refresh(self) -> None:
        """Read the tokens again."""
        self._tokens.refresh()


class AccessMiddleware:
    """Passes a request on with the person's name in its state, or refuses it."""

    def __init__(
        self,
        app: ASGIApp,
        settings: Operator,
        people: People,
        signed_in: Callable[[tuple[str, int] | None, str], None],
    ) -> None:
        """`signed_in` gets the client's address and port, and the person, with each request of one who may make it."""
        self._app, self._people, self._signed_in = app, people, signed_in
        self._secure, self._is_local = settings.tls is not None, is_loopback(settings.host)
        self._sessions: dict[str, SignIn] = {}
        self._failed, self._clients = FailedSignIns(), RefusedClients()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = await self._refusal(scope, receive)
        if refusal is None:
            await self._app(scope, receive, self._while_allowed(scope, send))
        else:
            await refusal(scope, receive, send)

    async def _refusal(self, scope: Scope, receive: Receive) -> Response | None:
        """The response to a request that is not passed on; None for one that is."""
        headers, path = Headers(scope=scope), scope["path"]
        method = "WEBSOCKET" if scope["type"] == "websocket" else scope["method"]
        if _is_cross_site(headers) or (
            is_fetched_elsewhere(headers.getlist("origin"), headers.getlist("sec-fetch-site"))
            and not _is_followed_link(method, headers)
        ):
            return self._refused(scope, 403, "pages of other sites may not use this service")
        if not self._people:
            return self._refusal_without_people(scope, headers)
        if path == "/login":
            return await self._log_in(Request(scope, receive)) if method == "POST" else _login_page("")
        signed_in = self._people.sign_in(headers.get("authorization")) or self._of_session(headers)
        if signed_in is None and "authorization" in headers:
            await self._slow_down(scope)
        return None if path == "/healthz" else self._refusal_of(signed_in, scope, method, headers)

    async def _slow_down(self, scope: Scope) -> None:
        """Let the answer to a wrong token wait, the longer the more there were from this address."""
        await asyncio.sleep(self._failed.delay_s(_address(scope), asyncio.get_running_loop().time()))

    def _refused(self, scope: Scope, status: int, reason: str, logged: str = "") -> Response:
        """The answer to a request of a program. `logged` is the reason in the log, if it is another there."""
        self._clients.note(f"{_address(scope)} at the operators' port", logged or reason)
        headers = {"www-authenticate": "Bearer"} if status == 401 else {}
        return JSONResponse({"detail": reason}, status, headers)

    def _refusal_without_people(self, scope: Scope, headers: Headers) -> Response | None:
        """Refuses other host names on a local port: such a request may be DNS rebinding by another site's page."""
        host = host_of(headers.get("host", ""))
        if self._is_local and not is_fixed(host):
            return self._refused(
                scope, 403, "use localhost or an address; to use another host name, name operator.people"
            )
        return None

    def _refusal_of(self, signed_in: SignIn | None, scope: Scope, method: str, headers: Headers) -> Response | None:
        person, role = (signed_in.person, self._people.role(signed_in)) if signed_in else ("", None)
        if signed_in is None or role is None:
            wants_page = method == "GET" and "text/html" in headers.get("accept", "")
            if wants_page:
                return _login_page("")
            logged = (
                "its token is nobody's" if "authorization" in headers else "it sends no token and has not signed in"
            )
            return self._refused(scope, 401, "send 'Authorization: Bearer TOKEN', or sign in", logged)
        needed = role_needed(method, scope["path"])
        if RANK[role] < RANK[needed]:
            return self._refused(scope, 403, f"{person} has the role {role}; this takes the role {needed}")
        self._signed_in(scope.get("client"), person)
        scope.setdefault("state", {})["person"] = person
        scope["state"]["signed_in"] = signed_in
        return None

    def _while_allowed(self, scope: Scope, send: Send) -> Send:
        """A `send` that closes a WebSocket once its person may no longer read."""
        if scope["type"] != "websocket":
            return send
        signed_in: SignIn | None = scope.get("state", {}).get("signed_in")

        async def guarded(message: Message) -> None:
            gone = self._people and (signed_in is None or self._people.role(signed_in) is None)
            if gone and message["type"] == "websocket.send":
                await send({"type": "websocket.close", "code": 1008, "reason": "no longer allowed"})
                raise OSError  # Starlette treats it as a disconnect of the client
            await send(message)

        return guarded

    async def _log_in(self, request: Request) -> Response:
        body = b""
        try:
            async for chunk in request.stream():
                body += chunk
                if len(body) > MOST_FORM_BYTES:
                    return self._refused(request.scope, 413, "the form is too long")
        except ClientDisconnect:
            return Response(status_code=400)  # nobody is there to read it
        token = parse_qs(body.decode("utf-8", "replace")).get("token", [""])[0]
        signed_in = self._people.sign_in(f"Bearer {token}")
        if signed_in is None:
            await self._slow_down(request.scope)
            self._clients.note(
                f"{_address(request.scope)} at the operators' port", "it signs in with a token that is nobody's"
            )
            return _login_page("That token is not known.")
        session = secrets.token_urlsafe(32)
        theirs = [name for name, other in self._sessions.items() if other.person == signed_in.person]
        for name in theirs[: max(len(theirs) + 1 - MOST_SESSIONS, 0)]:
            del self._sessions[name]
        self._sessions[session] = signed_in
        answer = RedirectResponse("/", 303)
        answer.set_cookie(COOKIE, session, httponly=True, secure=self._secure, samesite="strict", path="/")
        return answer

    def _of_session(self, headers: Headers) -> SignIn | None:
        pairs = (pair.partition("=") for pair in headers.get("cookie", "").split(";"))
        sessions = (self._sessions.get(value.strip()) for name, _, value in pairs if name.strip() == COOKIE)
        return next(filter(None, sessions), None)


def _is_cross_site(headers: Headers) -> bool:
    """Whether another site's page sends the request, by its `Origin`: it would act with the operator's rights."""
    origin = headers.get("origin")
    try:
        return origin is not None and urlsplit(origin).netloc != headers.get("host")
    except ValueError:
        return True


def _is_followed_link(method: str, headers: Headers) -> bool:
    """Whether a person follows a link to this service in a window of its own, which the other page can't read."""
    return method == "GET" and (headers.get("sec-fetch-mode"), headers.get("sec-fetch-dest")) == (
        "navigate",
        "document",
    )


def _address(scope: Scope) -> str:
    """Of the client, or the network of an IPv6 address."""
    return site_of((scope.get("client") or ("",))[0])


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
