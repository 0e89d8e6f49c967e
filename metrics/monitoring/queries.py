"""The queries and panels that all dashboards use."""

from collections.abc import Iterable
from dataclasses import replace

from metrics.monitoring.panels import Panel, Query, panel
from metrics.monitoring.promql import Where, level, or_zero, or_zero_by_vendor, rate

WINDOW = "$__rate_interval"
"""Grafana's variable for the window of a rate."""
VENDOR = ["vendor"]
STATUS_WAIT = "deconflict_message_to_advisory_seconds"


def rated(name: str, by: Iterable[str] = (), legend: str = "") -> Query:
    """A counter per second. Its legend names the labels unless another is given."""
    return Query(rate(name, WINDOW, by), legend or labels_of(by))


def rated_by_vendor(name: str) -> Query:
    """A counter per second; 0 for each vendor that has robots but no result."""
    return Query(or_zero_by_vendor(rate(name, WINDOW, VENDOR)), labels_of(VENDOR))


def measured(
    name: str, by: Iterable[str] = (), legend: str = "", *, over: str = "sum", where: Where | None = None
) -> Query:
    """A gauge. Its legend names the labels unless another is given."""
    return Query(level(name, by, where=where, over=over), legend or labels_of(by))


def zero_if_absent(query: Query) -> Query:
    """A query of series that do not always exist; 0 while there is none."""
    return replace(query, promql=or_zero(query.promql))


def labels_of(by: Iterable[str]) -> str:
    """The legend that shows the values of these labels."""
    return " ".join(f"{{{{{label}}}}}" for label in by)


def each(title: str, unit: str, name: str, label: str, warn_above: float | None = None) -> Panel:
    """One line for each value of a label; 0 if the site has none."""
    return panel(title, unit, zero_if_absent(measured(name, [label], over="max")), warn_above=warn_above)


def number(title: str, unit: str, query: Query, **warn: float) -> Panel:
    """One number at the top of the page."""
    return panel(title, unit, query, kind="stat", columns=4, rows=5, **warn)
