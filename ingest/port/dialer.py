"""Connects to a fleet manager's server, again after each failure, and receives from it as from other connections."""

import asyncio
import logging
from collections.abc import Callable
from random import Random
from typing import cast

from websockets.asyncio.client import connect
from websockets.exceptions import InvalidHandshake, InvalidURI

from ingest.measures.outages import OutageLog
from ingest.port.frame_cutter import FrameCuttingClient, FrameCuttingConnection
from ingest.port.receiver import CLOSE_TIMEOUT_S, Receiver

log = logging.getLogger(__name__)

STEADY_S = 30.0
"""A connection that lasted this long resets the back-off, and its loss is logged."""


class Dialer:
    """Dials one address of one vendor. Proxies that the environment names are not used: the server is on the site."""

    def __init__(
        self,
        receiver: Receiver,
        url: str,
        vendor: str,
        clock: Callable[[], float],
        random: Random,
    ) -> None:
        self._receiver = receiver
        self._url, self._vendor = url, vendor
        self._clock, self._random = clock, random
        self.failures = 0
        """Attempts in a row that failed or did not last."""
        self._outages = OutageLog(clock)
        self._was_reached = False

    async def run(self) -> None:
        """Dial until cancelled. Returns at once if the address is not valid."""
        while True:
            began_s = self._clock()
            try:
                await self._converse()
                self._log_outage(f"the connection to {self._vendor} at {self._url} is lost; dialling again", began_s)
            except (OSError, TimeoutError, InvalidHandshake) as error:
                self._log_outage(
                    f"{self._vendor} at {self._url} can't be reached: {error}; trying until it answers", began_s
                )
            except InvalidURI as error:
                log.error("%s; mend the dial address of %s", error, self._vendor)
                return
            except Exception:
                log.exception("the conversation with %s at %s failed; dialling again", self._vendor, self._url)
            self.failures = 0 if self._is_steady(began_s) else self.failures + 1
            await asyncio.sleep(self.wait_s())

    def wait_s(self) -> float:
        """How long to wait before the next attempt, in seconds.

        It doubles with each failure, within bounds. A random part is taken off, so that dialers do not dial at once.
        """
        least_s, most_s = self._receiver.settings.dial_backoff_s
        full_s = min(least_s * 2.0 ** min(max(self.failures - 1, 0), 30), most_s)
        return full_s * self._random.uniform(0.5, 1.0)

    async def _converse(self) -> None:
        async with connect(
            self._url,
            compression=None,
            proxy=None,
            max_size=self._receiver.settings.max_message_bytes,
            open_timeout=self._receiver.settings.open_timeout_s,
            close_timeout=CLOSE_TIMEOUT_S,
            ping_interval=None,
            create_connection=FrameCuttingClient,
            logger=logging.getLogger("websockets.robots"),
        ) as socket:
            if self._outages.worked() or not self._was_reached:
                log.info("connected to %s at %s", self._vendor, self._url)
            self._was_reached = True
            connection = self._receiver.new_connection(self._url, "/", self._vendor, proven=True)
            await self._receiver.listen(cast(FrameCuttingConnection, socket), connection)

    def _is_steady(self, began_s: float) -> bool:
        return self._clock() - began_s > STEADY_S

    def _log_outage(self, text: str, began_s: float) -> None:
        """Log the first failure of an outage; of a fleet manager that comes and goes, not every outage."""
        if self._is_steady(began_s):
            self._outages.was_steady()
        more = self._outages.failed()
        if more is not None:
            log.warning("%s%s", text, more)
