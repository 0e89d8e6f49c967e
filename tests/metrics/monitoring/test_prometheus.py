"""A real Prometheus scrapes the service while simulated vendors talk to it; every panel then shows something."""

import asyncio
import shutil
import subprocess
from pathlib import Path
from typing import Any

import httpx
import pytest

from deconflict.roles.service import run_in_one_process
from deconflict.simulation.vendors.senders import RobotFloor, simulate, warehouse
from metrics.monitoring.alert_rules import RECORDING_RULES
from metrics.monitoring.dashboards import dashboards
from metrics.monitoring.exposition import render
from metrics.scoring.warnings.warning_judge import WarningJudge
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client
from tests.metrics.monitoring.made_prometheus import ROBOTS, WINDOWS, on_free_ports, prometheus

pytestmark = pytest.mark.skipif(not shutil.which("prometheus"), reason="prometheus is not installed")


async def answered(client: httpx.AsyncClient, query: str) -> bool:
    """Whether Prometheus has a number for the query, or a share of warnings of which none is judged yet. A query it
    can't read is an error."""
    for name, value in WINDOWS.items():
        query = query.replace(name, value)
    document: dict[str, Any] = (await client.get("/api/v1/query", params={"query": query})).json()
    assert document["status"] == "success", document
    is_judged = "judged" in query or "ahead" in query
    return any(series["value"][1] != "NaN" or is_judged for series in document["data"]["result"])


async def unanswered(client: httpx.AsyncClient, queries: dict[str, str]) -> dict[str, str]:
    return {what: query for what, query in queries.items() if not await answered(client, query)}


async def test_every_query_of_every_panel_and_rule_has_data_while_the_demo_runs(tmp_path: Path) -> None:
    queries = {
        f"{dashboard.title}: {panel.title}, {query.legend}": query.promql
        for dashboard in dashboards()
        for panel, query in dashboard.queries()
    }
    queries |= {rule.name: rule.name for rule in RECORDING_RULES}
    async with run_in_one_process(on_free_ports(), tmp_path / "data", render, make_judge=WarningJudge) as (
        receiver,
        operator,
    ):
        url = f"ws://127.0.0.1:{receiver.receiver.port}"
        talking = asyncio.create_task(simulate(url, RobotFloor(*warehouse(ROBOTS, 1)), None, stop=asyncio.Event()))
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
            document = (await client.get("/api/v1/rules")).json()["data"]["groups"]
            assert [rule["lastError"] for group in document for rule in group["rules"] if rule.get("lastError")] == []
        async with http_client() as face:
            scrape = (await face.get(f"http://127.0.0.1:{operator.port}/metrics")).content
    checked = subprocess.run(["promtool", "check", "metrics"], input=scrape, capture_output=True, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, b"", b"")
