from pathlib import Path
from typing import Any

import pytest

from benchmarks.planned_floors.floors.corridors import Corridors
from benchmarks.planned_floors.floors.kinds import simulate
from benchmarks.planned_floors.logs.messages import stamp
from benchmarks.planned_floors.logs.reduced_log import TELLS, reduce_log, reduced, reduced_lines
from benchmarks.planned_floors.logs.reports import robots_in_file
from benchmarks.planned_floors.truth.floor_truth import LOG

START_S = 1_790_000_000.0


def point(t_s: float, x_m: float) -> dict[str, Any]:
    return {"timestamp": stamp(t_s), "x": x_m, "y": 0.0}


def status(t_s: float = START_S, **keys: Any) -> dict[str, Any]:
    path = [point(t_s + ahead_s, ahead_s) for ahead_s in range(1, 11)]
    says = {"velocity": {"linear": 1.0}, "path": path, "destinations": [point(t_s + 20.0, 20.0)]}
    message = {"uuid": "a", "timestamp": stamp(t_s), "operationalState": "navigating", "location": {"x": 0.0, "y": 0.0}}
    return message | says | keys


@pytest.mark.parametrize(
    ("tells", "points", "destinations", "moves"),
    [
        ("10", 10, 1, True),
        ("3", 3, 1, True),
        ("1", 1, 1, True),
        ("none", 0, 0, True),
        ("destination", 0, 1, True),
        ("timed_destination", 0, 1, True),
        ("manual", 0, 0, True),
        ("position", 0, 0, False),
        ("position_30s", 0, 0, False),
    ],
)
def test_a_report_keeps_what_is_told(tells: str, points: int, destinations: int, *, moves: bool) -> None:
    kept = reduced(status(), TELLS[tells])
    assert (len(kept.get("path", ())), len(kept.get("destinations", ()))) == (points, destinations)
    assert ("velocity" in kept) is moves
    assert kept["location"] == status()["location"]
    assert kept["operationalState"] == ("manualOverride" if tells == "manual" else "navigating")


def test_a_destination_has_a_time_only_if_it_is_told() -> None:
    [timed], [untimed] = (
        reduced(status(), TELLS[name])["destinations"] for name in ("timed_destination", "destination")
    )
    assert timed == point(START_S + 20.0, 20.0)
    assert untimed == {"x": 20.0, "y": 0.0}


def test_the_end_of_the_path_is_the_destination_of_a_log_without_destinations() -> None:
    message = status(destinations=[])
    assert reduced(message, TELLS["timed_destination"])["destinations"] == [point(START_S + 10.0, 10.0)]
    assert "destinations" not in reduced(message, TELLS["3"])


def test_reports_are_left_out_to_the_told_interval() -> None:
    lines = [{"received": stamp(START_S + t_s), "message": status(START_S + t_s)} for t_s in range(120)]
    identity = {"received": stamp(START_S), "message": {"uuid": "a", "timestamp": stamp(START_S)}}
    kept = list(reduced_lines([identity, *lines], TELLS["position_30s"]))
    assert kept[0] == identity
    assert len(kept) == 5
    assert len(list(reduced_lines([identity, *lines], TELLS["position"]))) == 121


def test_a_reduced_log_has_the_same_motion_and_the_same_bytes_each_time(tmp_path: Path) -> None:
    simulate(Corridors("head_on", seconds=20.0, corridors=1)).save(tmp_path, {})
    outs = [tmp_path / "a.jsonl.gz", tmp_path / "b.jsonl.gz"]
    for out in outs:
        reduce_log(tmp_path / LOG, TELLS["2"], out)
    assert outs[0].read_bytes() == outs[1].read_bytes()
    for whole, less in zip(robots_in_file(tmp_path / LOG), robots_in_file(outs[0]), strict=True):
        assert [(report.t_s, report.x_m) for report in whole.reports] == [
            (report.t_s, report.x_m) for report in less.reports
        ]
        assert {len(report.path) for report in less.reports} == {2}
