from itertools import combinations
from pathlib import Path

import pytest

from metrics.monitoring.catalogue import CATALOGUE
from metrics.monitoring.dashboards import dashboards, files
from metrics.monitoring.panels import COLUMNS, Dashboard, as_json, names_in

KEPT = Path(__file__).parents[3] / "dashboards"


def test_the_kept_files_are_what_the_code_writes() -> None:
    kept = {str(path.relative_to(KEPT)): path.read_text() for path in KEPT.rglob("*") if path.is_file()}
    assert kept == files(), "run: deconflict dashboards dashboards"


def test_every_metric_is_in_a_panel_and_in_its_description() -> None:
    shown = set()
    for dashboard in dashboards():
        for panel in as_json(dashboard)["panels"]:
            asked = {name for target in panel.get("targets", []) for name in names_in(target["expr"])}
            assert all(CATALOGUE[name].help in panel["description"] for name in asked)
            shown |= asked
    assert shown == set(CATALOGUE)


@pytest.mark.parametrize("dashboard", dashboards(), ids=lambda dashboard: dashboard.uid)
def test_panels_do_not_overlap(dashboard: Dashboard) -> None:
    panels = as_json(dashboard)["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    places = [panel["gridPos"] for panel in panels]
    assert all(at["x"] + at["w"] <= COLUMNS for at in places)
    for a, b in combinations(places, 2):
        beside = a["x"] + a["w"] <= b["x"] or b["x"] + b["w"] <= a["x"]
        assert beside or a["y"] + a["h"] <= b["y"] or b["y"] + b["h"] <= a["y"]


@pytest.mark.parametrize("dashboard", dashboards(), ids=lambda dashboard: dashboard.uid)
def test_each_query_has_a_letter_and_each_column_of_a_table_a_name(dashboard: Dashboard) -> None:
    for panel in as_json(dashboard)["panels"]:
        targets = panel.get("targets", [])
        assert [target["refId"] for target in targets] == list("ABCDEFGHIJ"[: len(targets)])
        if panel["type"] == "table":
            renamed = panel["transformations"][1]["options"]["renameByName"]
            assert list(renamed) == [f"Value #{target['refId']}" for target in targets]
