import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.planned_floors import __main__ as command
from benchmarks.planned_floors.comparison.tells import ANY, HOURLY, SHOWN, TOLD, TRUE, ByTells, table_of_tells
from benchmarks.planned_floors.comparison.tells_limits import limits, verdict
from benchmarks.planned_floors.scoring.alerts import BELIEVER, SERVICE


def test_one_command_scores_robots_that_tell_more_and_less(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, floors = tmp_path / "out.json", tmp_path / "floors"
    arguments = f"tells --kinds head_on --seconds 60 --floors {floors} --tells 10 none --json {out}"
    command.main(arguments.split())
    kept = f"{floors}/head_on-1/log.jsonl.gz {floors}/head_on-1"
    command.main(f"tells --log {kept} --floors {floors} --tells none --baseline {out}".split())
    document = json.loads(out.read_text())
    assert list(document["kinds"]["head_on"]) == ["10", "none"]
    believed = {tells: of[BELIEVER][TOLD]["value"] for tells, of in document["kinds"]["head_on"].items()}
    assert believed["10"] > 0.9
    printed = capsys.readouterr().out
    assert "\nhead_on\n" in printed
    assert "\nhead_on-1\n" in printed
    assert "limits hold (without a baseline" in printed


def figure(value: float | None, half: float = 0.03) -> dict[str, Any]:
    return {"value": value, "of": 100, "interval": None if value is None else (value - half, value + half)}


def row(told_2s: float, any_alert: float = 0.9, true: float | None = 0.7, hourly: float = 50.0) -> Any:
    service = dict(zip(SHOWN, map(figure, (told_2s, any_alert, true, hourly)), strict=True))
    return {SERVICE: service, BELIEVER: service | {ANY: figure(0.9)}}


def beyond(by_tells: ByTells, before: ByTells | None = None) -> list[tuple[str, str]]:
    return [(limit.tells, limit.figure) for limit in limits(by_tells, before) if not limit.held]


def test_a_path_is_worth_no_less_than_no_path_a_destination_and_the_baseline() -> None:
    alone = {"10": row(0.8), "2": row(0.6), "none": row(0.5), "destination": row(0.6)}
    assert beyond(alone) == []
    assert beyond(alone | {"destination": row(0.61)}) == [("2", TOLD)]
    assert beyond(alone | {"none": row(0.61)}) == [("2", TOLD), ("destination", TOLD)]
    assert beyond(alone, {"2": row(0.62), "none": row(0.4)}) == [("2", TOLD)]


def test_three_points_are_compared_with_the_believer() -> None:
    assert beyond({"3": row(0.6, any_alert=0.81)}) == []
    assert beyond({"3": row(0.6, any_alert=0.79)}) == [("3", ANY)]
    assert beyond({"2": row(0.6, any_alert=0.79)}) == []


def test_long_paths_come_true_as_with_ten_points_and_short_ones_as_in_the_baseline() -> None:
    now = {"10": row(0.8, true=0.7), "3": row(0.8, true=0.64), "2": row(0.8, true=0.5)}
    assert beyond(now) == [("3", TRUE)]
    assert beyond(now, {"2": row(0.5, true=0.56)}) == [("3", TRUE), ("2", TRUE)]
    assert beyond(now | {"3": row(0.8, true=None)}) == []


def test_alerts_an_hour_are_compared_with_those_of_ten_points() -> None:
    assert beyond({"10": row(0.8), "none": row(0.5, hourly=60.0)}) == []
    assert beyond({"10": row(0.8), "none": row(0.5, hourly=61.0)}) == [("none", HOURLY)]


def test_ten_points_stay_in_the_interval_of_the_baseline() -> None:
    assert beyond({"10": row(0.8)}, {"10": row(0.82, 0.92, 0.72, 49.98)}) == []
    assert beyond({"10": row(0.8)}, {"10": row(0.82, 0.94, 0.74, 50.0)}) == [("10", ANY), ("10", TRUE)]


def test_the_verdict_gives_the_value_the_limit_and_whether_it_could_be_chance() -> None:
    lines = verdict({"10": row(0.8), "2": row(0.6), "none": row(0.62)}, None).splitlines()
    assert lines[0].startswith("3 of 4 limits hold (without a baseline")
    assert lines[1] == "- 2: outcomes told 2 s 0.60 below 0.62 (none of the same run), within its interval"


def test_the_table_has_the_baseline_only_if_there_is_one() -> None:
    now = {"10": row(0.8)}
    assert "baseline" not in table_of_tells(now)
    assert "baseline: outcomes told 2 s" in table_of_tells({"2": row(0.6)}, {"2": row(0.7)})
    assert "0.70 (0.67-0.73)" in table_of_tells({"2": row(0.6)}, {"2": row(0.7)})
