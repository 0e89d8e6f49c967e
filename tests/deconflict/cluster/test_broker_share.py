"""Which ingest hears which broker, and for how long."""

import json
from math import inf
from pathlib import Path
from typing import Any

import pytest

from deconflict.cluster.ingest_feed import BrokerShare, brokers_of
from deconflict.cluster.nats.nats_connection import NatsConnection
from deconflict.cluster.nats.shared_state import LEASE_S, SharedState
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import Site
from ingest.port.brokers.mqtt_source import MqttSource

NAMES = [f"broker {number}" for number in range(300)]
SITE = Site(mqtt_sources=tuple(MqttSource(name=name, host="a") for name in ("hall", "yard")))
Offers = dict[str, list[str]]


def owners(offers: Offers) -> dict[str, str]:
    """The hearer of each broker. Fails if one has two."""
    pairs = [(broker, ingest) for ingest in offers for broker in brokers_of(ingest, offers)]
    assert len(pairs) == len(dict(pairs))
    return dict(pairs)


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_every_broker_has_exactly_one_hearer_among_live_ingests(count: int) -> None:
    offers = {f"feed-{number}": NAMES for number in range(count)}
    chosen = owners(offers)
    assert chosen.keys() == set(NAMES)
    fair = len(NAMES) / count
    assert all(0.5 * fair < list(chosen.values()).count(ingest) < 1.5 * fair for ingest in offers)


def test_few_brokers_move_when_an_ingest_joins_and_only_to_it_and_back_when_it_leaves() -> None:
    offers = {f"feed-{number}": NAMES for number in range(4)}
    before, after = owners(offers), owners(offers | {"feed-new": NAMES})
    moved = [name for name in NAMES if before[name] != after[name]]
    assert {after[name] for name in moved} == {"feed-new"}
    assert 0 < len(moved) < 0.4 * len(NAMES)


def test_a_broker_goes_to_an_ingest_that_has_it_in_its_site_file() -> None:
    assert owners({"feed-a": [], "feed-b": NAMES, "engine": []}) == dict.fromkeys(NAMES, "feed-b")
    assert brokers_of("feed-gone", {"feed-b": NAMES}) == []


class Receiver(AsyncCaller):
    """Keeps the last grant. It may be hung."""

    def __init__(self) -> None:
        super().__init__(Path(), "receiver")
        self.granted: list[str] = []
        self.until_s = -inf
        self.hung = False

    async def call(self, name: str, payload: bytes = b"", within_s: float = 0.0) -> bytes:
        assert name == "grant_brokers"
        if self.hung:
            raise LinkDownError("receiver")
        self.granted, self.until_s = json.loads(payload)
        return b"granted"


class State(SharedState):
    """The members as told."""

    def __init__(self) -> None:
        super().__init__(NatsConnection(Cluster(nats=("nats://a",))))
        self.documents: dict[str, dict[str, Any]] = {}
        self.all_have_beaten, self.is_alone = True, False

    def is_cut_off(self) -> bool:
        return self.is_alone

    def members(self) -> dict[str, dict[str, Any]]:
        return self.documents

    def knows_members(self) -> bool:
        return self.all_have_beaten


class Ingest:
    """An ingest at a clock of the test's."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.receiver, self.state = Receiver(), State()
        self.share = BrokerShare("feed-a", self.state, self.receiver, SITE, lambda: self.now_s)

    async def beat(self, *, reaches_the_server: bool = True) -> None:
        """Half a second as it passes in the feed."""
        if reaches_the_server:
            self.state.documents["feed-a"] = {"brokers": self.share.offer()}
            self.share.note_heartbeat(self.now_s)
        await self.share.renew()
        self.now_s += 0.5

    @property
    def heard(self) -> list[str]:
        """What its receiver hears now."""
        return self.receiver.granted if self.now_s < self.receiver.until_s else []


async def hearing() -> Ingest:
    ingest = Ingest()
    while not ingest.heard:
        await ingest.beat()
    assert ingest.heard == ["hall", "yard"]
    return ingest


async def test_an_ingest_that_starts_hears_nothing_until_it_knows_those_that_start_with_it() -> None:
    ingest = Ingest()
    for _ in range(int(LEASE_S / 0.5)):
        await ingest.beat()
        assert ingest.heard == []
    await ingest.beat()
    assert ingest.heard == ["hall", "yard"]


async def test_an_ingest_hears_only_after_its_own_heartbeat_with_an_offer_came_back() -> None:
    ingest = Ingest()
    for _ in range(12):
        await ingest.beat()
        ingest.state.documents = {"feed-b": {"brokers": []}}
        await ingest.share.renew()
        assert ingest.heard == []
    await ingest.beat()
    assert ingest.heard == ["hall", "yard"]


async def test_an_ingest_without_touch_to_the_server_hears_nothing_after_its_lease() -> None:
    ingest = await hearing()
    beaten_s = ingest.now_s - 0.5
    while ingest.now_s < beaten_s + LEASE_S:
        await ingest.beat(reaches_the_server=False)
        assert ingest.receiver.until_s <= beaten_s + LEASE_S
    assert ingest.heard == []
    await ingest.beat(reaches_the_server=False)
    assert ingest.receiver.granted == []


async def test_an_ingest_that_no_server_is_connected_to_keeps_the_brokers_that_it_hears_and_takes_no_other() -> None:
    for ingest, kept in ((await hearing(), ["hall", "yard"]), (Ingest(), [])):
        ingest.state.is_alone, ingest.state.documents = True, {}
        for _ in range(3 * int(LEASE_S / 0.5)):
            await ingest.beat(reaches_the_server=False)
            assert ingest.heard == kept


async def test_an_ingest_whose_receiver_hangs_offers_nothing_once_its_last_grant_has_ended() -> None:
    ingest = await hearing()
    ingest.receiver.hung = True
    answered_s = ingest.now_s - 0.5
    assert ingest.heard == ingest.share.offer() == ["hall", "yard"]
    while ingest.share.offer():
        await ingest.beat()
    assert ingest.now_s == answered_s + LEASE_S
    assert ingest.heard == []
    ingest.receiver.hung = False
    for _ in range(2):
        await ingest.beat()
    assert ingest.heard == ["hall", "yard"]


async def test_after_a_reconnect_an_ingest_takes_no_more_brokers_until_all_have_sent_heartbeats() -> None:
    ingest = Ingest()
    ingest.state.all_have_beaten = False
    for _ in range(12):
        await ingest.beat()
    assert ingest.heard == []
    ingest.state.all_have_beaten = True
    await ingest.beat()
    ingest.state.all_have_beaten, ingest.state.documents = False, {}
    await ingest.beat()
    assert ingest.heard == ["hall", "yard"]


async def test_a_broker_that_left_the_site_file_is_given_up() -> None:
    ingest = await hearing()
    ingest.share.use(SITE.model_copy(update={"mqtt_sources": SITE.mqtt_sources[1:]}))
    await ingest.beat()
    assert ingest.heard == ["yard"]
    ingest.share.use(Site())
    await ingest.beat()
    assert ingest.receiver.granted == []
