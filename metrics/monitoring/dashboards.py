"""The Grafana dashboards and the Prometheus rules, as files.

Every metric of the catalogue is in one of the dashboards. A metric that none of `site_page`, `vendor_page` and
`health_page` uses gets its own panel, in the last row of the third dashboard.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from metrics.monitoring.alert_rules import ALERTING_RULES, RECORDING_RULES
from metrics.monitoring.catalogue import CATALOGUE
from metrics.monitoring.catalogue_entry import CatalogueEntry
from metrics.monitoring.health_page import ENGINE
from metrics.monitoring.panels import Dashboard, Panel, PanelRow, Query, as_json, names_in, panel
from metrics.monitoring.promql import quantile
from metrics.monitoring.queries import WINDOW, labels_of, measured, rated, zero_if_absent
from metrics.monitoring.site_page import SITE
from metrics.monitoring.vendor_page import VENDORS


def dashboards() -> list[Dashboard]:
    """All dashboards. The third also has a panel for each metric that no dashboard uses."""
    pages = [SITE, VENDORS, ENGINE]
    shown = {name for page in pages for _, query in page.queries() for name in names_in(query.promql)}
    rest = tuple(_single_metric_panel(name, entry) for name, entry in CATALOGUE.items() if name not in shown)
    if rest:
        pages[-1] = replace(ENGINE, rows=(*ENGINE.rows, PanelRow("More", rest)))
    return pages


def _single_metric_panel(name: str, entry: CatalogueEntry) -> Panel:
    """A panel of one metric, by all of its labels."""
    title = name.removeprefix("deconflict_").removesuffix("_total").replace("_", " ").capitalize()
    if entry.kind == "histogram":
        return panel(title, "s", Query(quantile(0.99, name, WINDOW, entry.labels), labels_of(entry.labels) or "p99"))
    if entry.kind == "counter":
        return panel(title, "ops", zero_if_absent(rated(name, entry.labels)))
    unit = "s" if name.endswith("_seconds") else "short"
    return panel(title, unit, zero_if_absent(measured(name, entry.labels, over="max")))


PROVIDER = """# Written by `deconflict dashboards`. Put it into Grafana's provisioning/dashboards/ and set the path.
apiVersion: 1
providers:
  - name: deconflict
    folder: deconflict
    type: file
    options: {path: /etc/grafana/dashboards/deconflict}
"""


def files() -> dict[str, str]:
    """All files for Grafana and Prometheus: content by file name."""
    documents = {
        f"grafana/{dashboard.uid}.json": json.dumps(as_json(dashboard), indent=1) + "\n" for dashboard in dashboards()
    }
    return documents | {"grafana/provider.yml": PROVIDER, "prometheus/deconflict.rules.yml": rules_file()}


def write(folder: Path) -> list[Path]:
    """Write every file below `folder`. Returns their paths."""
    written = []
    for name, content in files().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
        written.append(path)
    return written


def rules_file() -> str:
    """The rules as a file for Prometheus. Strings are quoted as JSON, which is also valid YAML."""
    return "\n".join(["# Written by `deconflict dashboards`.", "groups:", *_groups()]) + "\n"


def _groups() -> Iterator[str]:
    yield "  - name: deconflict-recorded"
    yield "    rules:"
    for rule in RECORDING_RULES:
        yield f"      - record: {rule.name}"
        yield f"        expr: {json.dumps(rule.query)}"
    yield "  - name: deconflict-alerts"
    yield "    rules:"
    for alert in ALERTING_RULES:
        yield f"      - alert: {alert.name}"
        yield f"        expr: {json.dumps(alert.query)}"
        yield f"        for: {alert.lasting}"
        yield f"        labels: {{severity: {alert.severity}}}"
        yield "        annotations:"
        yield f"          summary: {json.dumps(alert.summary)}"
        yield f"          description: {json.dumps(alert.description)}"
        yield f"          runbook_url: {json.dumps(alert.section)}"
