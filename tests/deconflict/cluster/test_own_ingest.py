"""A machine that no NATS server is connected to, as `deconflict serve` with all parts."""

import time
from pathlib import Path

from tests.deconflict.cluster.made_cluster import Broker, needs_server
from tests.deconflict.roles.made_service import Served, healthy
from tests.helpers.saying import HALL

pytestmark = needs_server

SITE = """
[cluster]
nats = ["{address}"]
tile_m = 32.0

[[datums]]
id = "{hall}"
name = "Hall"
"""


async def test_a_machine_goes_on_without_a_server_says_so_and_the_stream_has_it_later(tmp_path: Path) -> None:
    broker, site = Broker(tmp_path / "nats"), tmp_path / "site.toml"
    site.write_text(SITE.format(address=broker.address, hall=HALL))
    service = Served(tmp_path / "data", site)
    try:
        with service.running():
            await service.until("/healthz", healthy)
            broker.kill()
            health = await service.until("/healthz", lambda health: "cluster" in health)
            assert "robots of this machine only" in health["cluster"]["reason"] == health["notice"]
            assert health["roles"]["nats"] == "down"
            async with service.with_robots(time.time() - 18.0):
                alone = await service.until("/advisories", lambda answer: answer["advisories"])
                broker.start()
                health = await service.until("/healthz", lambda health: "cluster" not in health and healthy(health))
                assert health["notice"] == ""
                (advisory,) = alone["advisories"]
                kept = await service.until(
                    f"/advisories/{advisory['id']}", lambda answer: answer.get("advisories", [{}])[-1].get("seq")
                )
        assert [each["revision"] for each in kept["advisories"]] == list(range(1, len(kept["advisories"]) + 1))
        assert kept["advisories"][0]["seq"] < advisory["seq"], "the numbers of the stream"
    finally:
        broker.kill()
