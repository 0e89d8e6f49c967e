"""`deconflict whatif` on a log of a simulated floor with another planner."""

import json
from pathlib import Path

import pytest

from benchmarks.planned_floors.floors.kinds import made_of, simulate
from benchmarks.planned_floors.logs.messages import DATUM
from deconflict.__main__ import parser
from metrics.replay_files import LogError
from tests.helpers.commands import run

SITE = f"""
[[datums]]
id = "{DATUM}"
name = "Hall"

[[areas]]
name = "Middle"
outline_m = [[5.0, 18.0], [40.0, 18.0], [40.0, 26.0], [5.0, 26.0]]
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A log and its site file."""
    directory = tmp_path_factory.mktemp("whatif")
    simulate(made_of("blind", 2, 90.0)).save(directory, {})
    (directory / "site.toml").write_text(SITE)
    return directory / "log.jsonl.gz", directory / "site.toml"


def test_the_command_answers_in_words_and_as_json(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, site = files
    asked = ["--speed", "Middle", "0.5", "--seeds", "2", "--jobs", "1"]
    out = str(tmp_path / "answer.json")
    args = parser().parse_args(["whatif", str(log), "--site", str(site), *asked, "--json", out])
    code = args.run(args)
    document = json.loads((tmp_path / "answer.json").read_text())
    printed = capsys.readouterr().out
    assert code == (3 if document["problems"] else 0)
    assert "robots drive at 50% of their greatest speed at most in Middle" in printed
    assert set(document["figures"]) == {"lost_s", "trips", "delays"}
    assert "The model without the change: lost to others" in printed


def test_suggestions_come_from_the_losses_of_the_log(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, site = files
    run("whatif", log, "--site", site, "--suggest", "--seeds", "1", "--jobs", "1", "--json", tmp_path / "found.json")
    document = json.loads((tmp_path / "found.json").read_text())
    found = [*document["places"], *document["suggestions"]]
    assert bool(found) != bool(document["none_because"])
    printed = capsys.readouterr().out
    assert all(each["text"] in printed for each in found)


def test_other_settings_are_compared_by_two_replays_of_the_log(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, site = files
    run("whatif", log, "--site", site, "--set", "clearance=0.6", "--json", tmp_path / "answer.json")
    document = json.loads((tmp_path / "answer.json").read_text())
    assert [document[name]["scores"][0]["clearance_m"] for name in ("before", "after")] == [0.3, 0.6]
    assert "clearance 0.3 m and 0.6 m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "problem"),
    [
        (["--one-way", "Aisle 9"], "'Aisle 9' is no place on the floors of the log; the site file has Middle"),
        (["--speed", "Middle", "8"], "'8' is no share of a speed"),
        (["--widen", "Middle", "1.5m"], "'1.5m' is no width"),
        (["--speed", "Middle", "0.8", "--reverse"], "--reverse is for --one-way"),
    ],
)
def test_a_question_that_cannot_be_asked_says_what_to_change(
    files: tuple[Path, Path], asked: list[str], problem: str
) -> None:
    log, site = files
    with pytest.raises(LogError, match=problem):
        run("whatif", log, "--site", site, *asked)
