"""Which ingest of a cluster hears which broker of robots: each is heard by one ingest at a time.

Each ingest says in its heartbeats which brokers it offers to hear, and computes by itself which of them are its own. It
grants these to its receiver until the lease of its heartbeats ends, so that the receiver stops by itself.
"""

import json
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from hashlib import sha256
from math import inf

from deconflict.cluster.nats.shared_state import LEASE_S, SharedState
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.settings.site import Site

GRANT_TIMEOUT_S = 1.0


def hearer(broker: str, ingests: Iterable[str]) -> str | None:
    """The ingest that hears a broker; None without any. If one joins or leaves, only its own brokers move."""
    return max(ingests, key=lambda ingest: (sha256(f"{ingest} {broker}".encode()).digest(), ingest), default=None)


def brokers_of(ingest: str, offers: Mapping[str, Collection[str]]) -> list[str]:
    """The brokers that an ingest hears. `offers` has by live ingest the names of those that it can hear."""
    own = offers.get(ingest, ())
    return [broker for broker in own if hearer(broker, (each for each in offers if broker in offers[each])) == ingest]


class BrokerShare:
    """The brokers of one ingest. Times are of `clock`, which the receiver's process shares."""

    def __init__(
        self,
        ingest: str,
        state: SharedState,
        receiver: AsyncCaller,
        site: Site,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._ingest, self._state, self._receiver, self._clock = ingest, state, receiver, clock
        self._beaten_s = self._answered_s = -inf
        """When the last heartbeat that a server took, and the last call that the receiver answered, began."""
        self._joined_s = inf
        """When the first heartbeat that a server took began."""
        self._granted: list[str] = []
        self.use(site)

    def use(self, site: Site) -> None:
        """Share the brokers of these settings from now on."""
        self._configured = [source.name for source in site.mqtt_sources if source.host]

    def offer(self) -> list[str]:
        """The brokers that this ingest can hear: none if its receiver has not answered for the time of a lease."""
        return self._configured if self._clock() < self._answered_s + LEASE_S else []

    def note_heartbeat(self, began_s: float) -> None:
        """Take note that a server has taken a heartbeat with `offer`."""
        self._beaten_s, self._joined_s = began_s, min(self._joined_s, began_s)

    async def renew(self) -> None:
        """Tell the receiver which brokers to hear from now on. It hears none once this is not called for a while.

        While no NATS server answers, it goes on to hear those of before: this machine judges their robots by itself.
        """
        if not self._configured and not self._granted:
            return
        now_s, is_cut_off = self._clock(), self._state.is_cut_off()
        until_s = (self._answered_s if is_cut_off else min(self._beaten_s, self._answered_s)) + LEASE_S
        self._granted = (self._kept() if is_cut_off else self._own()) if now_s < until_s else []
        payload = json.dumps([self._granted, until_s if self._granted else 0.0]).encode()
        with suppress(LinkDownError):
            await self._receiver.call("grant_brokers", payload, GRANT_TIMEOUT_S)
            self._answered_s = now_s

    def _kept(self) -> list[str]:
        """Those that it hears now."""
        return [broker for broker in self._granted if broker in self._configured]

    def _own(self) -> list[str]:
        """Its brokers by the heartbeats; those of before until all members have had the time to send one.

        So ingests that start together take no brokers from each other.
        """
        is_new = self._clock() < self._joined_s + LEASE_S
        if is_new or not self._state.knows_members():
            return self._kept()
        offers = {member: document.get("brokers", ()) for member, document in self._state.members().items()}
        return brokers_of(self._ingest, offers)
