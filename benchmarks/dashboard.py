"""Draws a dashboard without Grafana, from its panels and queries and a real Prometheus that scrapes the demo.

python -m benchmarks.dashboard deconflict-site docs/dashboard.png --seconds 150
"""

import argparse
import asyncio
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from deconflict.roles.service import run_in_one_process
from deconflict.simulation.vendors.senders import RobotFloor, simulate, warehouse
from metrics.monitoring.dashboards import dashboards
from metrics.monitoring.exposition import render
from metrics.monitoring.panels import COLUMNS, as_json
from tests.metrics.monitoring.made_prometheus import ROBOTS, WINDOWS, on_free_ports, prometheus

INCHES_A_COLUMN, INCHES_A_ROW = 0.6, 0.42
PAPER, INK, FAINT, ALARM = "#f7f8fa", "#1f2430", "#8a93a3", "#c4372c"
LINES = ("#2563a8", "#d9732b", "#2c8a57", "#8456b3", "#b3475c", "#5f7285", "#a58a1b", "#2a9aa5")

Series = list[tuple[str, list[float], list[float]]]


async def measured(panels: list[dict[str, Any]], seconds: float) -> dict[int, Series]:
    """Each panel's series after the demo has run for `seconds`: name, seconds before the end, values."""
    with TemporaryDirectory() as name:
        async with run_in_one_process(on_free_ports(), Path(name) / "data", render) as (receiver, operator):
            url = f"ws://127.0.0.1:{receiver.receiver.port}"
            talking = asyncio.create_task(simulate(url, RobotFloor(*warehouse(ROBOTS, 1)), None, stop=asyncio.Event()))
            async with prometheus(Path(name), f"127.0.0.1:{operator.port}") as client:
                await asyncio.sleep(seconds)
                found = {panel["id"]: await series(client, panel, seconds) for panel in panels}
            talking.cancel()
    return found


async def series(client: httpx.AsyncClient, panel: dict[str, Any], seconds: float) -> Series:
    end_s, found = time.time(), []
    for target in panel.get("targets", []):
        query = target["expr"]
        for variable, window in WINDOWS.items():
            query = query.replace(variable, window)
        params = {"query": query, "start": end_s - seconds, "end": end_s, "step": 1}
        answer = (await client.get("/api/v1/query_range", params=params)).json()
        for result in answer["data"]["result"]:
            legend = target["legendFormat"]
            for label, value in result["metric"].items():
                legend = legend.replace(f"{{{{{label}}}}}", value)
            times, values = zip(*((float(t) - end_s, float(value)) for t, value in result["values"]), strict=True)
            found.append((legend if "{{" not in legend else "", list(times), list(values)))
    return found


def drawn(title: str, panels: list[dict[str, Any]], found: dict[int, Series]) -> Figure:
    """A figure of the panels at their positions in the dashboard."""
    high = max(panel["gridPos"]["y"] + panel["gridPos"]["h"] for panel in panels) + 1.6
    figure = Figure(figsize=(COLUMNS * INCHES_A_COLUMN, high * INCHES_A_ROW), facecolor=PAPER)
    figure.text(0.012, 1 - 0.8 / high, title, fontsize=15, color=INK, weight="bold", va="center")
    note = "drawn from its panels and a real Prometheus, without Grafana"
    figure.text(0.988, 1 - 0.8 / high, note, fontsize=9, color=FAINT, va="center", ha="right")
    for panel in panels:
        at = panel["gridPos"]
        left, top = at["x"] / COLUMNS, 1 - (at["y"] + 1.6) / high
        if panel["type"] == "row":
            figure.text(left + 0.012, top - 0.5 / high, panel["title"], fontsize=11, color=INK, va="center")
            continue
        inset = (0.9, 1.2, 1.3) if panel["type"] == "timeseries" else (0.3, 0.3, 0.3)
        wide, tall = at["w"] / COLUMNS, at["h"] / high
        box = (left + inset[0] / COLUMNS, top - tall + inset[1] / high)
        axes = figure.add_axes((*box, wide - (inset[0] + 0.3) / COLUMNS, tall - (inset[1] + inset[2]) / high))
        draw_panel(axes, panel, found[panel["id"]])
    return figure


def draw_panel(axes: Axes, panel: dict[str, Any], lines: Series) -> None:
    defaults = panel["fieldConfig"]["defaults"]
    axes.set_facecolor("white")
    axes.spines[:].set_color("#d7dce4")
    if panel["type"] == "stat":
        axes.set_xticks([])
        axes.set_yticks([])
        value = lines[0][2][-1] if lines else float("nan")
        text = f"{value:.1%}" if defaults["unit"] == "percentunit" else f"{value:g}"
        axes.text(0.5, 0.42, text, fontsize=22, ha="center", va="center", color=INK, transform=axes.transAxes)
        axes.text(0.5, 0.88, panel["title"], fontsize=9, ha="center", va="center", color=INK, transform=axes.transAxes)
        return
    axes.set_title(panel["title"], fontsize=9, loc="left", color=INK)
    for row, (name, times, values) in enumerate(sorted(lines)):
        axes.plot(times, values, lw=1.3, label=name or "_", color=LINES[row % len(LINES)])
    for step in defaults["thresholds"]["steps"][1:]:
        axes.axhline(step["value"], color=ALARM, lw=0.8, ls="--")
    axes.set_ylim(0, 1.5 * max((max(values) for _, _, values in lines), default=1.0) or 1.0)
    axes.set_xlabel("seconds before now", fontsize=6.5, color=FAINT, labelpad=1)
    axes.tick_params(labelsize=7, colors=FAINT)
    axes.grid(color="#e8ebf0")
    if any(name for name, _, _ in lines):
        axes.legend(fontsize=6.5, loc="upper left", ncols=2, frameon=False, labelcolor=INK)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("uid", choices=[dashboard.uid for dashboard in dashboards()])
    parser.add_argument("out", type=Path)
    parser.add_argument("--seconds", type=float, default=150.0)
    args = parser.parse_args()
    (chosen,) = [dashboard for dashboard in dashboards() if dashboard.uid == args.uid]
    panels = as_json(chosen)["panels"]
    found = asyncio.run(measured(panels, args.seconds))
    drawn(chosen.title, panels, found).savefig(args.out, dpi=80, facecolor=PAPER)


if __name__ == "__main__":
    main()
