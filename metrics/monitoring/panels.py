"""Dashboards as Grafana's JSON: panels of queries, laid out in rows of 24 columns."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from metrics.monitoring.catalogue import CATALOGUE

Document = dict[str, Any]
COLUMNS = 24
SCHEMA_VERSION = 39
"""Version of Grafana's dashboard JSON. Grafana 10 wrote this version; later releases can read it."""
SOURCE = {"type": "prometheus", "uid": "${source}"}


@dataclass(frozen=True, slots=True)
class Query:
    """A PromQL query, and the legend of its series, such as `{{vendor}}`."""

    promql: str
    legend: str = ""


@dataclass(frozen=True, slots=True)
class Panel:
    """One panel. Its description is the catalogue's help for the metrics that it shows."""

    title: str
    unit: str
    """Grafana's name of the unit: s, short, percentunit, reqps, Bps."""
    queries: tuple[Query, ...]
    kind: Literal["timeseries", "stat", "table"] = "timeseries"
    columns: int = 8
    """Width; a dashboard has 24 columns."""
    rows: int = 7
    """Height."""
    warn_above: float | None = None
    """A value above this is marked; None if no value is too high."""
    warn_below: float | None = None
    """A value below this is marked; None if no value is too low."""


def panel(title: str, unit: str, *queries: Query, **look: Any) -> Panel:
    """A panel of these queries. `look` holds the other fields of `Panel`."""
    return Panel(title, unit, queries, **look)


@dataclass(frozen=True, slots=True)
class PanelRow:
    """Panels under a heading."""

    title: str
    panels: tuple[Panel, ...]


def row(title: str, *panels: Panel) -> PanelRow:
    return PanelRow(title, panels)


@dataclass(frozen=True, slots=True)
class Dashboard:
    """One dashboard of rows."""

    uid: str
    title: str
    rows: tuple[PanelRow, ...]

    def queries(self) -> Iterator[tuple[Panel, Query]]:
        for row in self.rows:
            for panel in row.panels:
                for query in panel.queries:
                    yield panel, query


def names_in(promql: str) -> set[str]:
    """The metrics of the catalogue that a query uses."""
    names = (re.sub("_(bucket|sum|count)$", "", name) for name in re.findall(r"\bdeconflict_\w+", promql))
    return {name for name in names if name in CATALOGUE}


def as_json(dashboard: Dashboard) -> Document:
    """The dashboard in the form that Grafana reads from a file."""
    return {
        "uid": dashboard.uid,
        "title": dashboard.title,
        "tags": ["deconflict"],
        "schemaVersion": SCHEMA_VERSION,
        "editable": False,
        "refresh": "10s",
        "time": {"from": "now-1h", "to": "now"},
        "templating": {
            "list": [{"name": "source", "label": "Prometheus", "type": "datasource", "query": "prometheus"}]
        },
        "links": [{"type": "dashboards", "title": "deconflict", "tags": ["deconflict"], "asDropdown": True}],
        "panels": list(_laid_out(dashboard.rows)),
    }


def _laid_out(rows: Sequence[PanelRow]) -> Iterator[Document]:
    number, top = 0, 0
    for row in rows:
        number += 1
        at = {"h": 1, "w": COLUMNS, "x": 0, "y": top}
        yield {"id": number, "type": "row", "title": row.title, "collapsed": False, "gridPos": at, "panels": []}
        top, left, tallest = top + 1, 0, 0
        for panel in row.panels:
            if left + panel.columns > COLUMNS:
                top, left, tallest = top + tallest, 0, 0
            number += 1
            yield {"id": number, **_panel(panel), "gridPos": {"h": panel.rows, "w": panel.columns, "x": left, "y": top}}
            left, tallest = left + panel.columns, max(tallest, panel.rows)
        top += tallest


def _panel(panel: Panel) -> Document:
    defaults: Document = {"unit": panel.unit, "thresholds": {"mode": "absolute", "steps": list(_steps(panel))}}
    document: Document = {
        "type": panel.kind,
        "title": panel.title,
        "description": _description(panel.queries),
        "datasource": SOURCE,
        "targets": [_target(row, query, panel.kind) for row, query in enumerate(panel.queries)],
        "fieldConfig": {"defaults": defaults, "overrides": []},
        "options": {},
    }
    if panel.kind == "timeseries":
        shown = "area" if len(defaults["thresholds"]["steps"]) > 1 else "off"
        defaults["custom"] = {"fillOpacity": 8, "lineWidth": 1, "thresholdsStyle": {"mode": shown}}
        document["options"] = {"tooltip": {"mode": "multi", "sort": "desc"}, "legend": {"displayMode": "list"}}
    if panel.kind == "table":
        document["transformations"] = list(_one_table(panel.queries))
    return document


def _steps(panel: Panel) -> Iterator[Document]:
    good, bad = ("red", "green") if panel.warn_below is not None else ("green", "red")
    yield {"color": good, "value": None}
    bound = panel.warn_above if panel.warn_below is None else panel.warn_below
    if bound is not None:
        yield {"color": bad, "value": bound}


def _target(row: int, query: Query, kind: str) -> Document:
    target: Document = {"refId": _letter(row), "datasource": SOURCE, "expr": query.promql, "legendFormat": query.legend}
    if kind != "timeseries":
        target |= {"instant": True, "range": False}
    return target | ({"format": "table"} if kind == "table" else {})


def _one_table(queries: Sequence[Query]) -> Iterator[Document]:
    """One row for each vendor, and one column for each query, named by its legend."""
    yield {"id": "joinByField", "options": {"byField": "vendor", "mode": "outer"}}
    names = {f"Value #{_letter(row)}": query.legend for row, query in enumerate(queries)}
    times = {"Time": True} | {f"Time {row + 1}": True for row in range(len(queries))}
    yield {"id": "organize", "options": {"excludeByName": times, "renameByName": names}}


def _letter(row: int) -> str:
    return chr(ord("A") + row)


def _description(queries: Iterable[Query]) -> str:
    names = {name: None for query in queries for name in sorted(names_in(query.promql))}
    return "\n\n".join(f"{name}: {CATALOGUE[name].help}" for name in names)
