"""What the demo shows in a terminal: open advisories and the figures of each vendor."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory, Severity
from deconflict_client.counted_nouns import count_of
from ingest.languages.visible_text import visible
from ingest.measures.measures import Histogram, joined_values

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


def summary(figures: Mapping[str, float]) -> list[str]:
    """The figures of `DemoView.result` and what the ledger booked (`lost_to_others_s`), in sentences."""
    announced = ", ".join(f"{kind}: {figures[kind]}" for kind in ("conflicts", "queues", "deadlocks", "blockages"))
    return [
        f"Robots: {figures['robots']}, messages: {figures['messages']:,}, of these rejected: {figures['rejected']:,}.",
        f"{announced.capitalize()}.",
        f"Advisories raised: {figures['advisories_raised']}, cleared: {figures['advisories_cleared']}.",
        f"Robots and people lost {figures['lost_to_others_s']:.0f} s to each other.",
        f"99 % of the advisories came within {figures['latency_p99_ms']:.0f} ms of their message.",
    ]


def advisory_line(advisory: AnyAdvisory) -> Text:
    if advisory.state is AdvisoryState.CLEARED:
        return Text(visible(f"cleared  {' and '.join(advisory.names)}: {advisory.cleared_because}"))
    return Text(visible(f"{advisory.state.value:8} {advisory.summary}"))


def tables(view: DemoView, sentence: str) -> Group:
    result = view.result()
    counts = Text(
        f"{count_of(int(result['robots']), 'robot')}   {count_of(int(result['messages']), 'message')} "
        f"({result['rejected']} rejected)   "
        f"{count_of(view.raised, 'advisory', 'advisories')} raised, {view.cleared} cleared   "
        f"message to advisory p99 {result['latency_p99_ms']:.0f} ms"
    )
    notes = [Text("Advisory, not safety rated. Ctrl-C ends.")]
    if sentence:
        notes.insert(0, Text(sentence))
    if view.preparing:
        done, total = view.preparing["done"], view.preparing["total"]
        compiling = f"Preparing the engine, once on this machine: {done} of {total} kernels"
        doing = compiling if done < total else "The engine starts"
        text = f"{doing}. Then conflicts are predicted."
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
