import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from deconflict.operator.http.json_schemas import SCHEMAS
from deconflict.settings.site import Site
from deconflict_client.situations import REVISION
from ingest.languages import timestamps
from ingest.settings import Vendor
from metrics.report.replay_summary import first_sentences
from metrics.scoring.warnings.warning_quality import WarningQuality
from tests.helpers.commands import run
from tests.helpers.saying import identity, robot, status
from tests.metrics.replay.made_replays import NOW_S, log_of_a_crossing, scored

STRAIGHT_ON = {0.3: (0.81, 0.29), 0.5: (0.91, 0.45)}
"""Recall and precision on mrclam7.cv, by clearance, of alerts wherever forecasts come within it."""
RECORDINGS = os.environ.get("DECONFLICT_RECORDINGS")


def log_of_a_jump(path: Path) -> Path:
    """Two that stand 20 m apart, and nearly in one place from the twelfth second on."""
    lines = []
    for second in range(25):
        t_s = NOW_S + second
        for name, x in (("A-1", 0.0), ("B-1", 20.0 if second < 12 else 0.2)):
            raw = status(name, t_s, x, 0.0, 0.0, operationalState="idle")
            if second == 0:
                lines.append(f'{{"received":"{timestamps.write(t_s)}","message":{identity(name, t_s).decode()}}}\n')
            lines.append(f'{{"received":"{timestamps.write(t_s + 0.05)}","message":{raw.decode()}}}\n')
    path.write_text("".join(lines))
    return path


def test_a_perfect_vendor_is_scored_perfect(tmp_path: Path) -> None:
    result = scored(log_of_a_crossing(tmp_path / "log.jsonl"), [0.3])
    (figures,) = result["scores"]
    assert (result["messages"], result["robots"]) == (52, 2)
    assert (figures["encounters"], figures["recall"], figures["precision"]) == (1, 1.0, 1.0)
    assert figures["lead_time_s"]["median"] > 6


def test_robots_that_report_standing_but_move_are_predicted_by_their_motion(tmp_path: Path) -> None:
    (figures,) = scored(log_of_a_crossing(tmp_path / "log.jsonl", expected=False), [0.3])["scores"]
    assert (figures["encounters"], figures["recall"], figures["precision"]) == (1, 1.0, 1.0)
    assert figures["lead_time_s"]["median"] > 3


def test_robots_that_jump_are_not_predicted(tmp_path: Path) -> None:
    (figures,) = scored(log_of_a_jump(tmp_path / "log.jsonl"), [0.3])["scores"]
    assert (figures["encounters"], figures["foreseeable"], figures["recall"]) == (1, 1, 0.0)
    assert figures["lead_time_s"] is None
    assert figures["cases"]["recalled"] == "n"


def test_a_crossing_is_one_situation_that_came_true(tmp_path: Path) -> None:
    figures = scored(log_of_a_crossing(tmp_path / "log.jsonl"), [0.3])["situations"]
    assert (figures["situations"], figures["true"], figures["by_kind"][0]["kind"]) == (1, 1, "meeting")
    assert figures["lead_time_s"]["median"] > 6
    assert (figures["foreseen"], figures["open_at_once"]["most"]) == ({"outcomes": 1, "covered": 1.0}, 1)


def test_without_encounters_there_is_no_recall_and_no_alert(tmp_path: Path) -> None:
    (figures,) = scored(log_of_a_crossing(tmp_path / "log.jsonl", apart_m=8.0), [0.3])["scores"]
    assert (figures["encounters"], figures["alerts"], figures["censored"]) == (0, 0, 0)
    assert figures["recall"] is figures["precision"] is None
    assert figures["robot_hours"] == pytest.approx(2 * 24 / 3600)


def test_people_are_counted_apart_and_no_robot_hour_has_them(tmp_path: Path) -> None:
    walkers = Vendor(name="Alder", participants={"person": (robot("B-1"),), "driven": ("0*",)})
    result = scored(log_of_a_crossing(tmp_path / "log.jsonl"), [0.3], Site(vendors=(walkers,)))
    (figures,) = result["scores"]
    assert result["participants"] == {"robot": 1, "person": 1}
    assert first_sentences(result).startswith("In 0.4 minutes, 1 robot, 1 person of 1 vendor got in each other's way")
    hours = (
        figures["robot_hours"],
        figures["warnings"]["robot_hours"],
        figures["warnings"]["by_vendor"][0]["robot_hours"],
    )
    assert hours == pytest.approx((24 / 3600,) * 3)
    assert figures["warnings"]["by_minute"][0]["robots"] <= 1.0


def test_what_two_people_do_to_each_other_is_no_event_of_the_report(tmp_path: Path) -> None:
    log = log_of_a_crossing(tmp_path / "log.jsonl")
    of_robots = scored(log, [0.3])
    people = Vendor(name="Alder", participants={"person": (robot("A-1"), robot("B-1"))})
    of_people = scored(log, [0.3], Site(vendors=(people,)))
    figures = [result["scores"][0] for result in (of_robots, of_people)]
    assert [(each["encounters"], WarningQuality.of(each["warnings"]).events) for each in figures] == [(1, 1), (0, 0)]
    assert of_people["nearest"] == []


def test_figures_are_also_by_vendor(tmp_path: Path) -> None:
    (figures,) = scored(log_of_a_crossing(tmp_path / "log.jsonl"), [0.3])["scores"]
    (alder,) = figures["by_vendor"]
    (both,) = figures["by_vendor_pair"]
    assert (alder["vendor"], alder["recall"], both["vendors"], both["alerts"]) == ("Alder", 1.0, ["Alder", "Alder"], 1)


def test_the_command_writes_scores_and_the_revisions_of_the_stream(tmp_path: Path) -> None:
    log = log_of_a_crossing(tmp_path / "log.jsonl")
    messages, results, revisions = [], [], []
    for name in ("1", "2"):
        out, lines, situations = tmp_path / f"{name}.json", tmp_path / f"{name}.jsonl", tmp_path / f"{name}.situations"
        words = ["replay", str(log), "--clearance", "0.0", "0.3", "--json", str(out)]
        words += ["--advisories", str(lines), "--situations", str(situations)]
        if name == "1":
            run(*words)
        else:
            subprocess.run([sys.executable, "-m", "deconflict", *words], check=True)
        assert [load["clearance_m"] for load in json.loads(out.read_text())["scores"]] == [0.0, 0.3]
        messages.append((tmp_path / f"{name}-0.3.jsonl").read_bytes())
        revisions.append([REVISION.validate_json(line) for line in situations.read_bytes().splitlines()])
        results.append({**json.loads(out.read_text()), "speed_x_real_time": 0})
    assert messages[0] == messages[1]
    assert json.dumps(results[0]) == json.dumps(results[1])
    assert revisions[0] == revisions[1]
    assert [revision.state for revision in revisions[0]][:: len(revisions[0]) - 1] == ["raised", "cleared"]


def test_the_advisories_of_each_clearance_are_in_the_format_of_the_stream(tmp_path: Path) -> None:
    log, out = log_of_a_crossing(tmp_path / "log.jsonl"), tmp_path / "out.jsonl"
    outputs = ("--json", tmp_path / "scores.json", "--situations", tmp_path / "situations.jsonl", "--advisories", out)
    run("replay", log, "--clearance", "0.0", "0.3", *outputs)
    schema = Draft202012Validator(SCHEMAS["advisory"]())
    situations = {json.loads(line)["id"] for line in (tmp_path / "situations.jsonl").read_text().splitlines()}
    for clearance_m in (0.0, 0.3):
        revisions = [json.loads(line) for line in (tmp_path / f"out-{clearance_m:g}.jsonl").read_text().splitlines()]
        for revision in revisions:
            schema.validate(revision)
        assert [revision["seq"] for revision in revisions] == list(range(1, len(revisions) + 1))
        assert {revision["clearance_m"] for revision in revisions} == {clearance_m}
        assert [revision["state"] for revision in revisions][:: len(revisions) - 1] == ["raised", "cleared"]
        if clearance_m == 0.0:
            assert {revision["situation_id"] for revision in revisions} & situations


@pytest.mark.skipif(not RECORDINGS, reason="DECONFLICT_RECORDINGS names no folder of recordings")
def test_a_perfect_vendor_of_real_motion_is_predicted() -> None:
    result = scored(Path(RECORDINGS or "") / "mrclam7.oracle.jsonl.gz", [0.3])
    (figures,) = result["scores"]
    assert figures["recall"] > 0.9
    assert figures["precision"] > 0.6


@pytest.mark.skipif(not RECORDINGS, reason="DECONFLICT_RECORDINGS names no folder of recordings")
def test_straight_forecasts_give_a_precision_at_least_two_fifths_above_the_baseline() -> None:
    result = scored(Path(RECORDINGS or "") / "mrclam7.cv.jsonl.gz", list(STRAIGHT_ON))
    for figures, (recall, precision) in zip(result["scores"], STRAIGHT_ON.values(), strict=True):
        assert figures["recall"] >= recall
        assert figures["precision"] >= 1.4 * precision
        assert figures["ece"] <= 0.05
        assert figures["brier_skill"] >= 0.15
    assert all(0.88 <= row["covered_90"] <= 0.92 for row in result["forecast_error"]["all"])


def test_an_override_acts_like_a_site_setting_and_results_are_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = log_of_a_crossing(tmp_path / "log.jsonl")
    near, far = tmp_path / "near.json", tmp_path / "far.json"
    for clearance, out in (("0.2", near), ("0.6", far)):
        run("replay", log, "--set", f"clearance={clearance}", "--json", out)
    run("replay", "--compare", near, far)
    assert "clearance 0.2 m and 0.6 m: 1 and 1 foreseeable encounters" in capsys.readouterr().out


def test_a_missing_log_is_reported_in_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "deconflict", "replay", str(tmp_path / "none.jsonl")]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "none.jsonl can't be read" in done.stderr
