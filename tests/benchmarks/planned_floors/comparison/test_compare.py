import json
from pathlib import Path

import pytest

from benchmarks.planned_floors import __main__ as command
from benchmarks.planned_floors.comparison.compare import Plan, compared, log_cases, make
from benchmarks.planned_floors.floors.corridors import Corridors
from benchmarks.planned_floors.floors.kinds import KINDS, made_of
from benchmarks.planned_floors.scoring.alerts import BELIEVER, SERVICE
from benchmarks.planned_floors.scoring.all_figures import figures
from benchmarks.planned_floors.truth.floor_truth import LOG, STOPS
from deconflict.engine.engine import Engine


@pytest.fixture(scope="module")
def corridor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("corridor")
    make(Corridors("head_on", seconds=90.0, corridors=2), directory)
    return directory


def test_the_service_and_the_believer_are_scored_on_the_same_stops(corridor: Path) -> None:
    cases = log_cases(corridor / LOG, corridor, 0.3)
    assert set(cases) == {BELIEVER, SERVICE}
    assert len(cases[BELIEVER].stops) == len(cases[SERVICE].stops) >= 3
    assert figures(cases[BELIEVER])["stops told 4 s"]["value"] == 1.0
    assert len(cases[SERVICE].probabilities) > 20


def test_switching_off_a_part_changes_the_advisories(corridor: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deaf(engine: Engine) -> None:
        monkeypatch.setattr(engine, "receive", lambda _batch: None)

    monkeypatch.setattr("benchmarks.planned_floors.comparison.compare.PARTS", {"hearing": deaf})
    cases = log_cases(corridor / LOG, corridor, 0.3, parts=["hearing"])
    assert len(cases["without hearing"].verdicts) == 0 < len(cases[SERVICE].verdicts)


def test_advisories_of_a_file_score_as_in_one_process(corridor: Path, tmp_path: Path) -> None:
    advisories, out = tmp_path / "late.jsonl", tmp_path / "scores.json"
    advisories.write_text("")
    arguments = ["score", str(corridor / LOG), str(corridor / STOPS), str(advisories), "--json", str(out)]
    command.main(arguments)
    scores = json.loads(out.read_text())
    assert scores[BELIEVER]["stops told 4 s"]["value"] == 1.0
    assert scores["late"]["stops told 4 s"]["value"] == 0.0
    assert scores["late"]["alerts per robot-hour"]["value"] == 0.0


def test_an_existing_floor_is_not_made_again(tmp_path: Path) -> None:
    floor = Corridors("two_way", seconds=2.0, corridors=1)
    make(floor, tmp_path)
    (tmp_path / LOG).write_bytes(b"")
    make(floor, tmp_path)
    assert (tmp_path / LOG).read_bytes() == b""
    make(Corridors("two_way", seconds=3.0, corridors=1), tmp_path)
    assert (tmp_path / LOG).read_bytes()


def test_floors_of_several_seeds_are_scored_together(tmp_path: Path) -> None:
    plan = Plan(kinds=["two_way"], seeds=[1, 2], floors=tmp_path, clearance_m=0.3, seconds=30.0)
    [comparison] = compared(plan, 1)
    assert comparison.setting.name == "two_way"
    assert comparison.whole[BELIEVER]["robot-hours"]["value"] == pytest.approx(2 * 40 * 30 / 3600)
    assert set(comparison.by_seed) == {1, 2}


def test_each_kind_and_time_between_reports_has_a_table_of_its_own(tmp_path: Path) -> None:
    floors, tables = tmp_path / "floors", tmp_path / "tables"
    arguments = f"compare --kinds two_way head_on --seeds 3 --floors {floors} --tables {tables} --jobs 2"
    command.main([*arguments.split(), "--report-every", "1", "5", "--seconds", "12"])
    names = {f"{kind}-every-{every_s}s" for kind in ("two_way", "head_on") for every_s in (1, 5)}
    files = {f"{name}.{kind_of_file}" for name in names for kind_of_file in ("md", "json")}
    assert {path.name for path in tables.iterdir()} == files
    document = json.loads((tables / "head_on-every-5s.json").read_text())
    assert (document["kind"], document["report_every_s"], list(document["seeds"])) == ("head_on", 5.0, ["3"])
    assert {BELIEVER, SERVICE} == set(document["whole"]) == set(document["seeds"]["3"])
    assert "| service" in (tables / "head_on-every-5s.md").read_text()
    log_bytes = [(floors / f"two_way-every-{every_s}s-3" / LOG).stat().st_size for every_s in (1, 5)]
    assert log_bytes[0] > 3 * log_bytes[1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_keeps_what_is_asked_of_it(kind: str) -> None:
    floor = made_of(kind, 7, seconds=30.0, report_every_s=5.0)
    assert (floor.seed, floor.seconds) == (7, 30.0)
    reports = [floor] if isinstance(floor, Corridors) else floor.vendors
    assert {habits.report_every_s for habits in reports} == {5.0}
