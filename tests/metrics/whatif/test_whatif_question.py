"""`deconflict whatif` on a log of a simulated floor with another planner."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks.planned_floors.floors.kinds import made_of, simulate
from benchmarks.planned_floors.logs.messages import DATUM
from deconflict.__main__ import parser
from metrics.replay_files import LogError
from tests.helpers.commands import run
from tests.helpers.patience import PATIENCE_S

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
    simulate(made_of("blind", 2, 45.0)).save(directory, {})
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


def workers(pid: int) -> list[int]:
    """The processes that a command has forked."""
    begins = Path(f"/proc/{pid}/cmdline").read_bytes()
    children = map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
    return [child for child in children if Path(f"/proc/{child}/cmdline").read_bytes() == begins]


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_is_left_of_a_command_that_is_killed(files: tuple[Path, Path], end: signal.Signals) -> None:
    log, site = files
    asked = ["whatif", log, "--site", site, "--speed", "Middle", "0.5", "--seeds", "400", "--jobs", "2"]
    with subprocess.Popen([sys.executable, "-m", "deconflict", *map(str, asked)], stderr=subprocess.DEVNULL) as command:
        until_s, forked = time.monotonic() + PATIENCE_S, list[int]()
        while len(forked) < 2 and command.poll() is None and time.monotonic() < until_s:
            forked = workers(command.pid)
            time.sleep(0.05)
        command.send_signal(end)
    assert len(forked) == 2
    while any(map(is_running, forked)) and time.monotonic() < until_s:
        time.sleep(0.05)
    assert not any(map(is_running, forked))


def test_into_a_pipe_that_is_closed_nothing_but_lines_is_written(files: tuple[Path, Path]) -> None:
    log, site = files
    asked = f"whatif {log} --site {site} --speed Middle 0.5 --seeds 2 --jobs 2"
    command = f"set -o pipefail; {sys.executable} -m deconflict {asked} | head -1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False)
    assert done.returncode in {0, 3}
    assert done.stdout.count(b"\n") == 1
    assert b"\r" not in done.stderr + done.stdout
    assert b"Traceback" not in done.stderr


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
