"""A real Prometheus that scrapes a running service."""

import asyncio
import json
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import httpx

from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from metrics.monitoring.dashboards import rules_file
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client

ROBOTS = 24

WINDOWS = {"$__rate_interval": "30s"}


def on_free_ports() -> Site:
    site = load(demo_site())
    ports = {"receiver": site.receiver, "operator": site.operator}
    return site.model_copy(update={name: section.model_copy(update={"port": 0}) for name, section in ports.items()})


@asynccontextmanager
async def prometheus(folder: Path, target: str) -> AsyncIterator[httpx.AsyncClient]:
    """A server that scrapes `target` every second and evaluates the rules as often."""
    (port,) = free_ports(1)
    (folder / "rules.yml").write_text(rules_file())
    (folder / "prometheus.yml").write_text(
        json.dumps(
            {
                "global": {"scrape_interval": "1s", "evaluation_interval": "1s"},
                "rule_files": ["rules.yml"],
                "scrape_configs": [{"job_name": "deconflict", "static_configs": [{"targets": [target]}]}],
            }
        )
    )
    with (folder / "prometheus.log").open("w") as log:
        server = subprocess.Popen(
            [
                "prometheus",
                f"--config.file={folder / 'prometheus.yml'}",
                f"--storage.tsdb.path={folder / 'tsdb'}",
                f"--web.listen-address=127.0.0.1:{port}",
            ],
            stdout=log,
            stderr=log,
        )
        try:
            async with http_client(f"http://127.0.0.1:{port}") as client:
                await ready(client)
                yield client
        finally:
            server.terminate()
            server.wait()


async def ready(client: httpx.AsyncClient) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while True:
            with suppress(httpx.TransportError):
                if (await client.get("/-/ready")).is_success:
                    return
            await asyncio.sleep(0.05)
