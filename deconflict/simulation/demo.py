"""The demo: the whole service, four simulated vendors that connect to it over real sockets, and a live table."""

import asyncio
import json
import signal
import socket
import sys
import threading
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from deconflict.advisory import ADVISORY, AdvisoryState, AnyAdvisory, ConflictAdvisory, Severity
from deconflict.roles.service import runtime_directory
from deconflict.roles.supervisor import Supervisor
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.settings.site import Site
from deconflict.simulation.vendors.senders import simulate
from ingest.languages.visible_text import visible
from ingest.measures.measures import Histogram, joined_values

SECONDS_WITHOUT_TERMINAL = 60.0
START_WITHIN_S = 60.0
"""For its ports to open; the engine may take longer."""
REFRESH_S = 0.5
COLOURS = {Severity.CAUTION: "cyan", Severity.WARNING: "yellow", Severity.CRITICAL: "bold red"}


@dataclass(slots=True, eq=False)
class DemoView:
    """The displayed data: open advisories from the stream, and counts from the service's own measures."""

    open: dict[str, AnyAdvisory] = field(default_factory=dict)
    kinds: Counter[str] = field(default_factory=Counter)
    """Number of raised advisories, by kind."""
    encounters: set[tuple[str, str, int]] = field(default_factory=set)
    """Pair and encounter number of each published conflict."""
    raised: int = 0
    cleared: int = 0
    values: dict[str, dict[tuple[str, ...], float]] = field(default_factory=dict)
    latency_p99_s: float = 0.0
    preparing: dict[str, int] | None = None
    """How many kernels are `done` of the `total`; None if the engine is up."""

    def add_advisory(self, advisory: AnyAdvisory) -> None:
        if isinstance(advisory, ConflictAdvisory):
            self.encounters.add((*advisory.robots, advisory.encounter))
        if advisory.state is AdvisoryState.CLEARED:
            self.cleared += 1
            self.open.pop(advisory.id, None)
            return
        if advisory.state is AdvisoryState.RAISED and advisory.acknowledgement is None:
            self.raised += 1
            self.kinds[advisory.kind] += 1
        self.open[advisory.id] = advisory

    def measure(self, documents: list[dict[str, Any]]) -> None:
        self.values = joined_values(documents)
        for document in documents:
            if waits := document["histograms"].get("deconflict_message_to_advisory_seconds"):
                self.latency_p99_s = Histogram.joined(waits).quantile(0.99)

    def total(self, name: str, *, label: str | None = None) -> int:
        return round(sum(value for labels, value in self.values.get(name, {}).items() if label in (None, *labels)))

    def by_vendor(self, name: str) -> dict[str, float]:
        sums: dict[str, float] = {}
        for labels, value in self.values.get(name, {}).items():
            sums[labels[0]] = sums.get(labels[0], 0.0) + value
        return sums

    def result(self) -> dict[str, float]:
        """The figures that the demo prints at its end."""
        return {
            "messages": self.total("deconflict_messages_total"),
            "rejected": self.total("deconflict_messages_total", label="rejected"),
            "robots": self.total("deconflict_robots"),
            "conflicts": len(self.encounters),
            "queues": self.kinds["contention"],
            "deadlocks": self.kinds["deadlock"],
            "blockages": self.kinds["blockage"],
            "advisories_raised": self.raised,
            "advisories_cleared": self.cleared,
            "latency_p99_ms": round(self.latency_p99_s * 1000, 1),
        }


def demo(site: Site, robots: int, seconds: float | None, seed: int, data: Path | None) -> int:
    """Run the demo. It ends `seconds` after the engine is up, or after a minute if there is no terminal."""
    console = Console()
    if seconds is None and not console.is_terminal:
        seconds = SECONDS_WITHOUT_TERMINAL
    site = _on_free_ports(site, console)
    with TemporaryDirectory(prefix="deconflict-demo-") as discarded, runtime_directory() as runtime:
        kept = data or Path(discarded)
        kept.mkdir(parents=True, exist_ok=True)
        stop = threading.Event()
        supervisor = threading.Thread(target=Supervisor(site, kept, Path(runtime)).run, args=(stop,))
        supervisor.start()
        try:
            view = asyncio.run(_show(site, Path(runtime), console, robots, seconds, seed))
        except TimeoutError:
            sys.stderr.write(f"deconflict: the service did not start within {START_WITHIN_S:.0f} s; its log says why\n")
            return 1
        finally:
            stop.set()
            supervisor.join()
    sys.stdout.write(json.dumps(view.result()) + "\n")
    return 0


def _on_free_ports(site: Site, console: Console) -> Site:
    """The site with every occupied port replaced by a free one. Prints each replacement."""
    changed = {}
    for name in ("receiver", "operator"):
        section = getattr(site, name)
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((section.host, section.port))
                port = probe.getsockname()[1]
            except OSError:
                probe.bind((section.host, 0))
                port = probe.getsockname()[1]
                console.print(f"Port {section.port} is in use. The {name} listens on {port} instead.")
        changed[name] = section.model_copy(update={"port": port})
    return site.model_copy(update=changed)


async def _show(site: Site, runtime: Path, console: Console, robots: int, seconds: float | None, seed: int) -> DemoView:
    stop, loop, view = asyncio.Event(), asyncio.get_running_loop(), DemoView()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    operator = AsyncCaller(runtime, "operator")
    console.print("Starting the service …")
    await _until_ports_open(operator, stop)
    _print_addresses(site, console, robots)
    limit = _stop_later(operator, view, console, seconds, stop)
    async with _background(_follow(site, view, console), _measure(operator, view), limit):
        simulating = asyncio.create_task(simulate(_robots_url(site), robots, None, seed, stop=stop))
        if console.is_terminal:
            with Live(console=console, screen=False, auto_refresh=False) as live:
                while not simulating.done():
                    live.update(tables(view), refresh=True)
                    await asyncio.wait({simulating}, timeout=REFRESH_S)
        await simulating
        await asyncio.sleep(site.engine.tick_s)
        view.measure(json.loads(await operator.call("measures")))
    return view


@asynccontextmanager
async def _background(*work: Any) -> AsyncIterator[None]:
    tasks = [asyncio.create_task(coroutine) for coroutine in work]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _until_ports_open(operator: AsyncCaller, stop: asyncio.Event) -> None:
    """Raises `TimeoutError`."""
    async with asyncio.timeout(START_WITHIN_S):
        while not stop.is_set():
            with suppress(LinkDownError):
                if json.loads(await operator.call("health"))["roles"]["receiver"] == "up":
                    return
            await asyncio.sleep(0.05)


async def _stop_later(
    operator: AsyncCaller, view: DemoView, console: Console, seconds: float | None, stop: asyncio.Event
) -> None:
    """Show how far the engine is, and stop `seconds` after it is up."""
    while not stop.is_set():
        with suppress(LinkDownError):
            health = json.loads(await operator.call("health"))
            if health["roles"]["engine"] == "up":
                break
            if health["preparing"] and view.preparing is None and not console.is_terminal:
                console.print("Robots move. The engine is being prepared, once on this machine: a minute or two")
            view.preparing = health["preparing"]
        await asyncio.sleep(REFRESH_S)
    if view.preparing and not console.is_terminal:
        console.print("The engine is ready: conflicts are predicted from now on")
    view.preparing = None
    if seconds is not None:
        await asyncio.sleep(seconds)
        stop.set()


def _robots_url(site: Site) -> str:
    return f"ws://{site.receiver.host}:{site.receiver.port}"


def _print_addresses(site: Site, console: Console, robots: int) -> None:
    face = f"{site.operator.host}:{site.operator.port}"
    console.print(
        Text(f"{visible(site.name)}: {robots} simulated robots of four vendors connect to {_robots_url(site)}")
    )
    console.print(f"Open http://{face}/ to see the floor and the predictions", style="bold")
    console.print(f"Advisories  http://{face}/advisories   stream ws://{face}/advisories/stream")
    console.print(f"Robots      http://{face}/robots       metrics http://{face}/metrics")


async def _follow(site: Site, view: DemoView, console: Console) -> None:
    """Follow the stream as a site service does: from the last sequence number, again after every lost connection."""
    seen = 0
    while True:
        url = f"ws://{site.operator.host}:{site.operator.port}/advisories/stream?after={seen}"
        try:
            async with connect(url) as stream:
                async for message in stream:
                    advisory = ADVISORY.validate_json(message)
                    seen = advisory.seq
                    view.add_advisory(advisory)
                    if not console.is_terminal and advisory.state is not AdvisoryState.UPDATED:
                        console.print(advisory_line(advisory), soft_wrap=True)
        except (OSError, ConnectionClosed):
            await asyncio.sleep(REFRESH_S)


async def _measure(operator: AsyncCaller, view: DemoView) -> None:
    while True:
        with suppress(LinkDownError):
            view.measure(json.loads(await operator.call("measures")))
        await asyncio.sleep(2 * REFRESH_S)


def advisory_line(advisory: AnyAdvisory) -> Text:
    if advisory.state is AdvisoryState.CLEARED:
        return Text(visible(f"cleared  {' and '.join(advisory.names)}: {advisory.cleared_because}"))
    return Text(visible(f"{advisory.state.value:8} {advisory.summary}"))


def tables(view: DemoView) -> Group:
    result = view.result()
    counts = Text(
        f"{result['robots']} robots   {result['messages']} messages ({result['rejected']} rejected)   "
        f"{view.raised} advisories raised, {view.cleared} cleared   "
        f"message to advisory p99 {result['latency_p99_ms']:.0f} ms"
    )
    notes = [Text("Advisory, not safety rated. Ctrl-C ends.")]
    if view.preparing:
        done, total = view.preparing["done"], view.preparing["total"]
        text = f"Preparing the engine, once on this machine: {done} of {total} kernels. Then conflicts are predicted."
        notes.insert(0, Text(text, style="yellow"))
    return Group(counts, _advisories(view), _vendors(view), *notes)


def _advisories(view: DemoView) -> Table:
    table = Table(title="Open advisories", expand=True)
    for column in ("severity", "in", "what", "separation", "vendors"):
        table.add_column(column)
    for advisory in sorted(view.open.values(), key=lambda opened: opened.predicted_at):
        severity = Text(advisory.severity.value, style=COLOURS[advisory.severity])
        table.add_row(
            severity,
            f"{advisory.time_to_conflict_s:.0f} s",
            Text(visible(advisory.summary)),
            f"{advisory.min_separation_m:.2f} m" if isinstance(advisory, ConflictAdvisory) else "",
            Text(visible(" / ".join(advisory.vendors))),
        )
    if not view.open:
        table.add_row("", "", "none", "", "")
    return table


def _vendors(view: DemoView) -> Table:
    table = Table(title="Vendors", expand=True)
    for column in ("vendor", "robots", "messages", "deviations", "clock", "forecast age"):
        table.add_column(column)
    messages, deviations = (
        view.by_vendor("deconflict_messages_total"),
        view.by_vendor("deconflict_deviations_total"),
    )
    robots, clocks = view.by_vendor("deconflict_robots"), view.by_vendor("deconflict_clock_offset_seconds")
    ages = view.by_vendor("deconflict_forecast_age_seconds")
    for vendor in sorted(robots):
        table.add_row(
            Text(visible(vendor)),
            f"{robots[vendor]:.0f}",
            f"{messages.get(vendor, 0):.0f}",
            f"{deviations.get(vendor, 0):.0f}",
            f"{0.0 - clocks.get(vendor, 0):+.1f} s",
            f"{ages.get(vendor, 0):.1f} s",
        )
    return table
