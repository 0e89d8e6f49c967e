"""A real Prometheus scrapes the service while simulated vendors talk to it; every panel then shows something."""

import asyncio
import json
import shutil
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest

from deconflict.roles.service import in_one_process
from deconflict.settings.site import Site, load
from deconflict.simulation.demo import demo_site
from deconflict.simulation.vendors.senders import simulate
from metrics.monitoring.alert_rules import RECORDED, rules_file
from metrics.monitoring.dashboards import dashboards
from metrics.monitoring.exposition import render
from tests.deconflict.roles.test_supervisor import free_ports
from tests.helpers.patience import PATIENCE_S

pytestmark = pytest.mark.skipif(not shutil.which("prometheus"), reason="prometheus is not installed")

ROBOTS = 24
WINDOWS = {"$__rate_interval": "30s"}


def on_free_ports() -> Site:
    site = load(demo_site())
    ports = {"receiver": site.receiver, "operator": site.operator}
    return site.model_copy(update={name: one.model_copy(update={"port": 0}) for name, one in ports.items()})


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
            async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE_S) as client:
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


async def answered(client: httpx.AsyncClient, query: str) -> bool:
    """Whether Prometheus has a number for the query. A query it can't read is an error."""
    for name, value in WINDOWS.items():
        query = query.replace(name, value)
    told: dict[str, Any] = (await client.get("/api/v1/query", params={"query": query})).json()
    assert told["status"] == "success", told
    return any(series["value"][1] != "NaN" for series in told["data"]["result"])


async def unanswered(client: httpx.AsyncClient, queries: dict[str, str]) -> dict[str, str]:
    return {what: query for what, query in queries.items() if not await answered(client, query)}


async def test_every_query_of_every_panel_and_rule_has_data_while_the_demo_runs(tmp_path: Path) -> None:
    queries = {
        f"{one.title}: {panel.title}, {query.legend}": query.promql
        for one in dashboards()
        for panel, query in one.queries()
    }
    queries |= {one.name: one.name for one in RECORDED}
    async with in_one_process(on_free_ports(), tmp_path / "data", render) as (receiver, operator):
        url = f"ws://127.0.0.1:{receiver.receiver.port}"
        talking = asyncio.create_task(simulate(url, ROBOTS, None, 1, stop=asyncio.Event()))
        async with prometheus(tmp_path, f"127.0.0.1:{operator.port}") as client:
            try:
                async with asyncio.timeout(PATIENCE_S):
                    while queries:
                        queries = await unanswered(client, queries)
                        await asyncio.sleep(0.5)
            except TimeoutError:
                pytest.fail(f"no data for {queries}")
            finally:
                talking.cancel()
            told = (await client.get("/api/v1/rules")).json()["data"]["groups"]
            assert [one["lastError"] for group in told for one in group["rules"] if one.get("lastError")] == []
        async with httpx.AsyncClient(timeout=PATIENCE_S) as face:
            scrape = (await face.get(f"http://127.0.0.1:{operator.port}/metrics")).content
    checked = subprocess.run(["promtool", "check", "metrics"], input=scrape, capture_output=True, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, b"", b"")
