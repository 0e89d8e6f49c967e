"""A cluster as people run it: a real NATS server, two ingests and three engines, one of which is killed."""

import asyncio
import time
from math import pi
from pathlib import Path

from deconflict_client.advisory import AdvisoryState
from tests.deconflict.cluster.made_cluster import cluster, lives, needs_server, until
from tests.deconflict.roles.made_service import Course, drive
from tests.helpers.plain_http import http_client

PAIRS = 6
pytestmark = needs_server


def crossings() -> tuple[dict[str, Course], dict[str, Course]]:
    """Pairs along a hall that cross one after the other; one of each speaks to either ingest."""

    def east(number: int) -> Course:
        return lambda t: (15.0 * number + t - 18.0 - 2.0 * number, 0.0, 0.0)

    def north(number: int) -> Course:
        return lambda t: (15.0 * number, t - 18.0 - 2.0 * number, pi / 2)

    return (
        {f"A-{number}": east(number) for number in range(PAIRS)},
        {f"B-{number}": north(number) for number in range(PAIRS)},
    )


async def test_no_advisory_is_lost_or_doubled_if_an_engine_is_killed(tmp_path: Path) -> None:
    async with cluster(tmp_path) as (machines, operator):
        base = f"http://127.0.0.1:{operator.port}"
        urls = [f"ws://127.0.0.1:{machines.start(name, 'receiver', 'feed')}" for name in ("west", "east")]
        for name in ("first", "second", "third"):
            machines.start(name, "engine")
        await until(base, "/healthz", lambda health: health["roles"]["engine"] == "up")
        start_s = time.time() - 6.0
        told_by = zip(urls, crossings(), strict=True)
        driving = [asyncio.create_task(drive(url, half, 300, start_s)) for url, half in told_by]
        await until(base, "/advisories", lambda listed: len(listed["advisories"]) >= 2)
        machines.kill("second", "engine")
        whole = await until(
            base,
            "/advisories?state=all",
            lambda listed: sum(each["state"] == "cleared" for each in listed["advisories"]) >= PAIRS,
        )
        for each in driving:
            each.cancel()
        await asyncio.gather(*driving, return_exceptions=True)
        await until(base, "/situations", lambda listed: not listed["situations"])
        whole = await until(base, "/advisories?state=all", lambda listed: listed["seq"] >= whole["seq"])
        every = await lives(base)
        assert len(every) == len({life[0].robots for life in every}) == PAIRS
        for life in every:
            assert [each.revision for each in life] == list(range(1, len(life) + 1))
            assert [each.state for each in life if each.state is not AdvisoryState.UPDATED] == [
                AdvisoryState.RAISED,
                AdvisoryState.CLEARED,
            ]
        situations = await lives(base, "situations")
        for life in situations:
            assert [each.revision for each in life] == list(range(1, len(life) + 1))
        numbers = sorted(each.seq for life in (*every, *situations) for each in life)
        assert numbers[: whole["seq"]] == list(range(1, whole["seq"] + 1))
        async with http_client() as client:
            answer = {"name": "Ada", "reason": "seen"}
            response = await client.post(f"{base}/advisories/{every[0][0].id}/acknowledgement", json=answer)
        assert (response.status_code, "is cleared" in response.json()["detail"]) == (409, True)
