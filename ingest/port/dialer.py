"""Connects to a fleet manager's server, again after each failure, and receives from it as from other connections."""

import asyncio
import logging
from collections.abc import Callable
from random import Random
from typing import Any, cast
from urllib.parse import urlsplit, urlunsplit

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidHandshake, InvalidStatus, InvalidURI, SecurityError

from ingest.measures.measures import Measures
from ingest.measures.outages import STEADY_S, OutageLog, backoff_s
from ingest.port.frame_cutter import FrameCuttingClient, FrameCuttingConnection
from ingest.port.receiver import CLOSE_TIMEOUT_S, Receiver

log = logging.getLogger(__name__)

LONGEST_TARGET = 200
"""Characters of a redirect's target that are logged."""


class SameHostDial(connect):
    """Follows a redirect to the same host alone, at the network address that was dialled.

    Robots that are heard there count as proven. Whoever answers for the fleet manager may name any other address, and
    the owner of a name can make it mean another machine between two connections.
    """

    def __init__(self, url: str, **arguments: Any) -> None:
        super().__init__(url, create_connection=cast(type[ClientConnection], self._new_connection), **arguments)
        self._dialled: FrameCuttingClient | None = None

    def process_redirect(self, exc: Exception) -> Exception | str:
        """The address to go on at, or the exception to raise."""
        pinned = self.create_connection_kwargs.pop("host", None)
        if not isinstance(exc, InvalidStatus) or "Location" not in exc.response.headers:
            return exc
        try:
            target = super().process_redirect(exc)
            if isinstance(target, Exception):
                return target
            is_same_host = urlsplit(target).hostname == urlsplit(self.uri).hostname
        except (InvalidURI, LookupError, ValueError) as error:
            return SecurityError(f"it redirects to an address that can't be dialled: {shown(str(error))}")
        if not is_same_host or self._dialled is None:
            return SecurityError(f"it redirects to another host, {shown(target)}, which is not followed")
        self.create_connection_kwargs["host"] = pinned or self._dialled.remote_address[0]
        return target

    def _new_connection(self, *arguments: Any, **named: Any) -> FrameCuttingClient:
        self._dialled = FrameCuttingClient(*arguments, **named)
        return self._dialled


class Dialer:
    """Dials one address of one vendor. Proxies that the environment names are not used: the server is on the site."""

    def __init__(
        self,
        receiver: Receiver,
        measures: Measures,
        url: str,
        vendor: str,
        clock: Callable[[], float],
        random: Random,
    ) -> None:
        self._receiver, self._measures = receiver, measures
        self._url, self._vendor = url, vendor
        self._shown = without_credentials(url)
        self._clock, self._random = clock, random
        self.failures = 0
        """Attempts in a row that failed or did not last."""
        self._outages = OutageLog(clock)
        self._reached = ""
        """Where the newest connection ended up."""

    async def run(self) -> None:
        """Dial until cancelled. Returns at once if the address is not valid."""
        while True:
            began_s = self._clock()
            try:
                await self._converse()
                self._log_outage(f"the connection to {self._vendor} at {self._shown} is lost; dialling again", began_s)
            except (OSError, TimeoutError, InvalidHandshake) as error:
                self._log_outage(
                    f"{self._vendor} at {self._shown} can't be reached: {error}; trying until it answers", began_s
                )
            except InvalidURI as error:
                log.error("%s: %s; mend the dial address of %s", self._shown, error.msg, self._vendor)
                return
            except Exception:
                log.exception("the conversation with %s at %s failed; dialling again", self._vendor, self._shown)
            self.failures = 0 if self._is_steady(began_s) else self.failures + 1
            self._measures.count("deconflict_dial_failures_total", self._vendor)
            await asyncio.sleep(backoff_s(self._receiver.settings.dial_backoff_s, self.failures, self._random))

    async def _converse(self) -> None:
        dial = SameHostDial(
            self._url,
            compression=None,
            proxy=None,
            max_size=self._receiver.settings.max_message_bytes,
            open_timeout=self._receiver.settings.open_timeout_s,
            close_timeout=CLOSE_TIMEOUT_S,
            ping_interval=None,
            logger=logging.getLogger("websockets.robots"),
        )
        async with dial as socket:
            if self._outages.worked() or self._reached != dial.uri:
                log.info("connected to %s at %s%s", self._vendor, self._shown, self._redirected(dial.uri))
            self._reached = dial.uri
            connection = self._receiver.new_connection(self._shown, "/", self._vendor, proven=True)
            await self._receiver.listen(cast(FrameCuttingConnection, socket), connection)

    def _redirected(self, uri: str) -> str:
        return "" if uri == self._url else f", which redirects to {shown(without_credentials(uri))}"

    def _is_steady(self, began_s: float) -> bool:
        return self._clock() - began_s > STEADY_S

    def _log_outage(self, text: str, began_s: float) -> None:
        """Log the first failure of an outage; of a fleet manager that comes and goes, not every outage."""
        more = self._outages.failed(was_steady=self._is_steady(began_s))
        if more is not None:
            log.warning("%s%s", text, more)


def without_credentials(url: str) -> str:
    """A URL without user and password, as it may be logged."""
    try:
        parts = urlsplit(url)
    except ValueError:
        return url
    return urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))


def shown(text: str) -> str:
    """What another machine sent, short and quoted for the log."""
    return repr(text[:LONGEST_TARGET])
