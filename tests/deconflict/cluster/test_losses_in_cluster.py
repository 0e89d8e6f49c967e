"""Lost time in a cluster: at the border of two tiles it counts once, in the ledger of each operator face."""

import asyncio
from pathlib import Path

from tests.deconflict.cluster.made_cluster import cluster, face, needs_server, until
from tests.deconflict.roles.made_service import wait_behind_another
from tests.helpers.plain_http import http_client

TILE_M = 32.0
pytestmark = needs_server


async def test_a_loss_at_the_border_of_two_engines_counts_once_in_every_ledger(tmp_path: Path) -> None:
    async with cluster(tmp_path, tile_m=TILE_M) as (machines, operator):
        base = f"http://127.0.0.1:{operator.port}"
        url = f"ws://127.0.0.1:{machines.start('hall', 'receiver', 'feed')}"
        for name in ("first", "second"):
            machines.start(name, "engine")
        await until(base, "/healthz", lambda health: health["roles"]["engine"] == "up")
        driving = [asyncio.create_task(wait_behind_another(url, TILE_M - 4.0))]
        found = await until(base, "/losses", lambda answer: answer.get("total", {}).get("losses"))
        async with face(machines, tmp_path / "another") as other:
            again = await until(
                f"http://127.0.0.1:{other.port}", "/losses", lambda answer: answer.get("total", {}).get("losses")
            )
            assert again["rows"] == found["rows"]
        async with http_client() as client:
            total = (await client.get(f"{base}/losses")).json()["total"]
        for each in driving:
            each.cancel()
        await asyncio.gather(*driving, return_exceptions=True)
    assert total["losses"] == 1
    assert 2.0 < total["lost_s"] < 4.0
