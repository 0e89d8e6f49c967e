"""Situations from robots to people, in the running service: listed, streamed to who asks, posted, kept."""

import asyncio
import json
import time
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect

from deconflict.operator.outlets.webhook_signatures import verified
from deconflict.settings.outlet_settings import Webhook
from tests.deconflict.operator.outlets.made_outlets import SECRET, hearing
from tests.deconflict.roles.made_service import MEETING, SITE, Running, drive, running
from tests.helpers.patience import PATIENCE_S


async def heard(service: Running, query: str, last: int) -> list[dict[str, Any]]:
    """What a subscriber hears up to a number, or after it."""
    revisions: list[dict[str, Any]] = []
    async with connect(f"ws://{service.face}/advisories/stream{query}") as subscriber, asyncio.timeout(PATIENCE_S):
        while not revisions or revisions[-1]["seq"] < last:
            revisions.append(json.loads(await subscriber.recv()))
    return revisions


async def test_a_situation_is_listed_streamed_to_who_asks_posted_and_kept_over_a_restart(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(SECRET)
    with hearing() as other:
        hook = Webhook(name="mes", url=other.url, secret=f"file:{tmp_path / 'secret'}")
        site = SITE.model_copy(update={"webhooks": (hook,)})
        async with running(tmp_path / "data", site) as service:
            driving = asyncio.create_task(drive(service.robots_url, MEETING, 60, time.time() - 15))
            open_now = await service.until("/situations", lambda listed: listed["situations"])
            (situation,) = open_now["situations"]
            listed = (await service.get("/advisories?state=all")).json()["advisories"]
            assert {each["kind"] for each in listed} == {"conflict"}
            assert situation["advisories"] == [each["id"] for each in listed]
            ended = await service.until("/situations?state=cleared", lambda listed: listed["situations"])
            driving.cancel()
            last = ended["situations"][0]["seq"]
            by_default = await heard(service, "?after=0", last=situation["seq"] + 1)
            assert {each["kind"] for each in by_default} == {"conflict"}
            assert situation["id"] in {each["situation_id"] for each in by_default}
            asked = await heard(service, "?after=0&kinds=situation", last)
            async with asyncio.timeout(PATIENCE_S):
                while len(other.heard) < len(asked):
                    await asyncio.sleep(0.05)
        posted = [verified(headers, body, SECRET, time.time()) for headers, body in other.heard]
    assert [json.loads(revision.model_dump_json()) for revision in posted][: len(asked)] == asked
    async with running(tmp_path / "data") as again:
        assert (await again.get(f"/situations/{situation['id']}")).json()["situations"] == asked
        assert await heard(again, "?after=0&kinds=situation", last) == asked
    assert [(each["id"], each["revision"]) for each in asked] == [
        (situation["id"], number) for number in range(1, len(asked) + 1)
    ]
