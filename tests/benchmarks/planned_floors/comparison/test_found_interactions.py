from pathlib import Path

from benchmarks.planned_floors.comparison.compare import make, site_with
from benchmarks.planned_floors.comparison.found_interactions import finder_figures
from benchmarks.planned_floors.floors.corridors import Corridors
from benchmarks.planned_floors.truth.floor_truth import LOG


def test_only_robots_that_brake_head_on_are_found(tmp_path: Path) -> None:
    make(Corridors("head_on", seconds=240.0, corridors=4), tmp_path)
    found = finder_figures(tmp_path / LOG, tmp_path, site_with(0.3))
    assert found["fresh stops found"]["of"] >= 20
    assert found["fresh stops found"]["value"] >= 0.9
    assert found["found, true"]["value"] >= 0.9


def test_robots_that_pass_with_room_have_no_interaction(tmp_path: Path) -> None:
    make(Corridors("two_way", seconds=120.0, corridors=4), tmp_path)
    assert finder_figures(tmp_path / LOG, tmp_path, site_with(0.3))["found, true"]["of"] == 0
