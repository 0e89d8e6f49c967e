"""Robots in, a signed request and a retained message out: outlets in the running service."""

import asyncio
import time
from pathlib import Path

from deconflict.operator.outlets.webhook_signatures import verified
from deconflict.roles.service import run_in_one_process
from deconflict.settings.outlet_settings import Mqtt, Webhook
from metrics.monitoring.exposition import render
from tests.deconflict.operator.http.served_face import until
from tests.deconflict.operator.outlets.made_outlets import SECRET, broker, hearing, held_now, needs_mosquitto
from tests.deconflict.roles.made_service import CROSSING, SITE, drive
from tests.helpers.patience import PATIENCE_S


@needs_mosquitto
async def test_a_conflict_reaches_every_outlet(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(SECRET)
    async with broker() as port:
        with hearing() as other:
            hook = Webhook(name="mes", url=other.url, secret=f"file:{tmp_path / 'secret'}", kinds=("advisory",))
            site = SITE.model_copy(
                update={"webhooks": (hook,), "mqtt": Mqtt(host="127.0.0.1", port=port, kinds=("advisory",))}
            )
            async with run_in_one_process(site, tmp_path / "data", render) as (receiver, _):
                holding = asyncio.create_task(held_of_an_advisory(port))  # from now on: it is open for seconds
                driving = asyncio.create_task(drive(f"ws://127.0.0.1:{receiver.receiver.port}", CROSSING, 20))
                await until(lambda: other.heard)
                headers, body = other.heard[0]
                advisory = verified(headers, body, SECRET, time.time())
                async with asyncio.timeout(PATIENCE_S):
                    held = await holding
                driving.cancel()
    assert (advisory.kind, advisory.state, advisory.revision) == ("conflict", "raised", 1)
    assert set(held) == {"deconflict/service", f"deconflict/advisories/{advisory.id}"}


async def held_of_an_advisory(port: int) -> dict[str, str]:
    """What the broker holds, once an advisory is among it."""
    held = await held_now(port)
    while not any("advisories" in topic for topic in held):
        await asyncio.sleep(0.05)
        held = await held_now(port)
    return held
