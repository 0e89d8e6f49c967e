"""Shares of senders in the time of the event loop."""

import asyncio
import time
from collections.abc import Callable

from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.port.fair_delivery import FairDelivery
from ingest.port.rate_limits import ArrivedMessage
from ingest.settings import ReceiverSettings

MESSAGE_S, MESSAGES = 0.001, 100
SHARE = 0.03


def spend(seconds: float) -> None:
    """Use processor time."""
    until_s = time.thread_time() + seconds
    while time.thread_time() < until_s:
        pass


async def send_at_once(deliver: Callable[[bytes, float, Connection], str | None]) -> None:
    """Send `MESSAGES`. What the limit of their sender does not let through is not waited for."""
    settings = ReceiverSettings(max_processor_share=SHARE)
    delivery = FairDelivery(settings, deliver, lambda *_: None, Measures(), lambda _: None)
    for _ in range(MESSAGES):
        delivery.add(ArrivedMessage(b"{}", 0.0, Connection(1, vendor="Alder")), asyncio.get_running_loop().time())
        delivery.slices.finish()
    await delivery.close()


async def test_rejected_messages_use_up_their_senders_share_sooner() -> None:
    accepted, rejected = list[bytes](), list[bytes]()

    def accept(raw: bytes, _: float, __: Connection) -> None:
        spend(MESSAGE_S)
        accepted.append(raw)

    def reject(raw: bytes, _: float, __: Connection) -> str:
        spend(MESSAGE_S)
        rejected.append(raw)
        return "not-json"

    await send_at_once(accept)
    await send_at_once(reject)
    assert 0 < 2 * len(rejected) < len(accepted) < MESSAGES


def from_maker(number: int, maker: str, *, proven: bool = False) -> ArrivedMessage:
    topic = f"uagv/v2/{maker}/{number}/state"
    sender = Connection(number, "hall", vendor=maker, language="vda5050", topic=topic, proven=proven)
    return ArrivedMessage(b"{}", 0.0, sender)


async def test_makers_that_only_topics_name_have_one_share_and_take_none_of_others() -> None:
    delivered: list[str | None] = []
    settings = ReceiverSettings(max_messages_per_s=1)

    def take(_: bytes, __: float, connection: Connection) -> None:
        delivered.append(connection.vendor)

    delivery = FairDelivery(settings, take, lambda *_: None, Measures(), lambda _: None)
    now_s = asyncio.get_running_loop().time
    for number in range(3000):
        delivery.add(from_maker(number, f"Maker {number}"), now_s())
        delivery.slices.finish()
    assert len(delivered) < 64
    delivery.add(from_maker(1, "KIT", proven=True), now_s())
    delivery.slices.finish()
    assert delivered[-1] == "KIT"
    await delivery.close()
