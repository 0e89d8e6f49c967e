import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

from ingest.measures.measures import FURTHEST, LARGEST, Measures
from metrics.monitoring.catalogue import CATALOGUE, UNCATALOGUED, table
from metrics.monitoring.exposition import combine, render

METRICS_PAGE = Path(__file__).parents[3] / "docs" / "metrics.md"

Series = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def scraped(*roles: Measures) -> Series:
    """What a Prometheus server would read: sample name and sorted labels to value."""
    body, _ = render([role.as_document() for role in roles])
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(body.decode())
        for sample in family.samples
    }


def everything() -> Measures:
    """One series of each metric of the catalogue."""
    measures = Measures()
    for name, entry in CATALOGUE.items():
        labels = tuple(f"some {label}" for label in entry.labels)
        if entry.kind == "histogram":
            measures.observe(name, [0.004, 0.2, 99.0], *labels)
        elif entry.kind == "counter":
            measures.count(name, *labels, by=3)
        else:
            measures.level(name, {labels: 2.5})
    return measures


def test_every_metric_of_the_catalogue_is_rendered_with_its_kind_and_help() -> None:
    body, content_type = render([everything().as_document()])
    families = {
        family.name + ("_total" if family.type == "counter" else ""): family
        for family in text_string_to_metric_families(body.decode())
    }
    assert set(families) == {*CATALOGUE, UNCATALOGUED}
    for name, entry in CATALOGUE.items():
        assert (families[name].type, families[name].documentation) == (entry.kind, entry.help)
        assert set(entry.labels) <= set(families[name].samples[0].labels)
    assert content_type.startswith("text/plain")


def test_counters_and_populations_of_two_roles_add_up_and_estimates_do_not() -> None:
    roles = [Measures(), Measures()]
    for role, value in zip(roles, (3.0, 4.0), strict=True):
        role.count("deconflict_messages_total", "Acme", "accepted", by=value)
        role.level("deconflict_robots", {("Acme", "idle"): value})
        role.level("deconflict_clock_offset_seconds", {("Acme",): value})
    roles[1].count("deconflict_messages_total", "Acme", "rejected")
    seen = scraped(*roles)
    assert seen["deconflict_messages_total", (("result", "accepted"), ("vendor", "Acme"))] == 7
    assert seen["deconflict_messages_total", (("result", "rejected"), ("vendor", "Acme"))] == 1
    assert seen["deconflict_robots", (("state", "idle"), ("vendor", "Acme"))] == 7
    assert seen["deconflict_clock_offset_seconds", (("vendor", "Acme"),)] == 4


def test_metrics_that_do_not_add_up_over_roles_are_gauges_of_the_catalogue() -> None:
    assert not LARGEST & FURTHEST
    assert {CATALOGUE[name].kind for name in LARGEST | FURTHEST} == {"gauge"}


def test_histograms_are_cumulative_and_add_up_over_roles() -> None:
    roles = [Measures(), Measures()]
    roles[0].observe("deconflict_sweep_duration_seconds", [0.004, 0.2])
    roles[1].observe("deconflict_sweep_duration_seconds", [0.2, 99.0])
    seen = scraped(*roles)
    buckets = {
        float(labels[0][1]): value for (name, labels), value in seen.items() if name.endswith("duration_seconds_bucket")
    }
    assert (buckets[0.005], buckets[0.15], buckets[0.25], buckets[10.0], buckets[float("inf")]) == (1, 1, 3, 3, 4)
    assert seen["deconflict_sweep_duration_seconds_count", ()] == 4
    assert seen["deconflict_sweep_duration_seconds_sum", ()] == pytest.approx(99.404)


def test_unusual_label_values_are_unchanged() -> None:
    measures = Measures()
    vendor = 'Ac"me\\ GmbH\n{x="y"} é'
    measures.level("deconflict_forecast_age_seconds", {(vendor,): 1.0})
    assert scraped(measures)["deconflict_forecast_age_seconds", (("vendor", vendor),)] == 1.0


def test_series_outside_the_catalogue_are_counted_by_name_and_all_others_are_served() -> None:
    measures = Measures()
    measures.count("deconflict_ticks_total")
    measures.count("deconflict_unheard_of_total", "x")
    measures.count("deconflict_unheard_of_total", "y")
    measures.count("deconflict_messages_total", "one label too few")
    measures.observe("deconflict_conflicts", [1.0])
    measures.count("deconflict_sweep_duration_seconds")
    measures.observe("deconflict_message_to_advisory_seconds", [1.0], "Acme", "a label too many")
    left_out = combine([measures.as_document()]).uncatalogued
    assert left_out == {
        "deconflict_unheard_of_total": 2,
        "deconflict_messages_total": 1,
        "deconflict_conflicts": 1,
        "deconflict_sweep_duration_seconds": 1,
        "deconflict_message_to_advisory_seconds": 1,
    }
    seen = scraped(measures)
    assert seen["deconflict_ticks_total", ()] == 1
    assert {labels[0][1]: value for (name, labels), value in seen.items() if name == UNCATALOGUED} == left_out
    assert len(seen) == 1 + len(left_out)


def test_histograms_with_different_bounds_are_not_mixed() -> None:
    document = Measures()
    document.observe("deconflict_sweep_duration_seconds", [0.2])
    other: dict[str, Any] = {
        "values": {},
        "histograms": {"deconflict_sweep_duration_seconds": [[[], [1.0], [5, 0], 2.0]]},
    }
    combined = combine([document.as_document(), other])
    assert combined.uncatalogued == {"deconflict_sweep_duration_seconds": 1}
    (row,) = combined.histograms["deconflict_sweep_duration_seconds"][()]
    assert sum(row[2]) == 1


def test_combining_does_not_change_the_documents() -> None:
    document = everything().as_document()
    combine([document, document])
    assert document == everything().as_document()


def test_names_follow_the_prometheus_conventions() -> None:
    for name, entry in CATALOGUE.items():
        assert name.startswith("deconflict_")
        assert name.endswith("_total") == (entry.kind == "counter")
        assert "robot" not in entry.labels


def test_the_metrics_page_lists_the_catalogue() -> None:
    assert table() in METRICS_PAGE.read_text(), f"docs/metrics.md must hold this table:\n\n{table()}"


@pytest.mark.skipif(not shutil.which("promtool"), reason="promtool is not installed")
def test_promtool_accepts_the_output() -> None:
    body, _ = render([everything().as_document()])
    checked = subprocess.run(["promtool", "check", "metrics"], input=body, capture_output=True, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, b"", b"")
