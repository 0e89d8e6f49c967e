"""The queries and panels that all dashboards use, and those of the quality of warnings, in the words of
`metrics/scoring/warnings/warning_quality.py`."""

from collections.abc import Iterable
from dataclasses import replace

from metrics.monitoring.panels import Panel, Query, panel
from metrics.monitoring.promql import Where, increase, level, or_zero, or_zero_by_vendor, quantile, rate

OUTCOMES = ("came_true", "in_vain", "not_judged")
_WARNINGS, _EVENTS = "deconflict_warnings_judged_total", "deconflict_events_judged_total"
_VENDOR_WARNINGS, _VENDOR_EVENTS = "deconflict_vendor_warnings_judged_total", "deconflict_vendor_events_judged_total"


def warnings(outcome: str, window: str, by: Iterable[str] = ()) -> str:
    """How many warnings came true, were in vain or are not judged."""
    return increase(_VENDOR_WARNINGS if by else _WARNINGS, window, by, where={"outcome": outcome})


def judged(window: str, by: Iterable[str] = ()) -> str:
    """How many warnings came true or were in vain."""
    by = list(by)
    return f"({_or_none('came_true', window, by)} + {_or_none('in_vain', window, by)})"


def share_came_true(window: str, by: Iterable[str] = ()) -> str:
    """The share that came true of the warnings that are judged."""
    by = list(by)
    return f"{_or_none('came_true', window, by)} / {judged(window, by)}"


def share_in_vain(window: str, by: Iterable[str] = ()) -> str:
    """The share in vain of the warnings that are judged."""
    by = list(by)
    return f"{_or_none('in_vain', window, by)} / {judged(window, by)}"


def share_warned_of(window: str, by: Iterable[str] = ()) -> str:
    """The share of the events that were warned of."""
    name, by = _VENDOR_EVENTS if by else _EVENTS, list(by)
    every = increase(name, window, by)
    return f"({increase(name, window, by, where={'warned_of': 'yes'})} or 0 * {every}) / {every}"


def ahead_by(window: str) -> str:
    """From raising the warning to the event that was warned of, median."""
    return quantile(0.5, "deconflict_warned_ahead_seconds", window)


def _or_none(outcome: str, window: str, by: list[str]) -> str:
    """So many warnings, or 0 where all had other outcomes."""
    every = increase(_VENDOR_WARNINGS if by else _WARNINGS, window, by)
    return f"({warnings(outcome, window, by)} or 0 * {every})"


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
