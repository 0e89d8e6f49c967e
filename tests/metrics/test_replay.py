import json
import os
import subprocess
import sys
from math import pi
from pathlib import Path

import pytest

from deconflict.site import DEFAULT
from ingest import stamps
from metrics.replay import replay
from tests.saying import identity, points, status

NOW_S = 1_790_000_000.0
RECORDINGS = os.environ.get("DECONFLICT_RECORDINGS")


def log_of_a_crossing(path: Path) -> Path:
    """Two that cross at 12 s, as a log of lines with `received` and `message`."""
    lines = []

    def say(t_s: float, raw: bytes) -> None:
        lines.append(f'{{"received":"{stamps.write(t_s)}","message":{raw.decode()}}}\n')

    for name in ("A-1", "B-1"):
        say(NOW_S, identity(name, NOW_S))
    for second in range(25):
        t_s = NOW_S + second
        for name, x, y, yaw in (("A-1", second - 12.0, 0.0, 0.0), ("B-1", 0.0, second - 12.0, pi / 2)):
            dx, dy = (1.0, 0.0) if name == "A-1" else (0.0, 1.0)
            path_points = points(*((t_s + i, x + dx * i, y + dy * i, yaw) for i in range(1, 11)))
            say(t_s + 0.05, status(name, t_s, x, y, yaw, path=path_points))
    path.write_text("".join(lines))
    return path


def test_a_perfect_vendor_is_scored_perfect(tmp_path: Path) -> None:
    result = replay([log_of_a_crossing(tmp_path / "log.jsonl")], DEFAULT, [0.3])
    (figures,) = result["scores"]
    assert (result["messages"], result["robots"]) == (52, 2)
    assert (figures["encounters"], figures["recall"], figures["precision"]) == (1, 1.0, 1.0)
    assert figures["lead_time_s"]["median"] > 7


def test_the_command_writes_scores_and_what_the_stream_would_have_said(tmp_path: Path) -> None:
    log = log_of_a_crossing(tmp_path / "log.jsonl")
    told = []
    for run in ("1", "2"):
        out, lines = tmp_path / f"{run}.json", tmp_path / f"{run}.jsonl"
        command = [sys.executable, "-m", "deconflict", "replay", str(log), "--clearance", "0.0", "0.3"]
        subprocess.run([*command, "--json", str(out), "--advisories", str(lines)], check=True)
        assert [one["clearance_m"] for one in json.loads(out.read_text())["scores"]] == [0.0, 0.3]
        told.append(lines.read_bytes())
    assert told[0] == told[1]
    events = [json.loads(line)["event"] for line in told[0].splitlines()]
    assert events.count("raised") == events.count("cleared") == 2


@pytest.mark.skipif(not RECORDINGS, reason="DECONFLICT_RECORDINGS names no folder of recordings")
def test_a_perfect_vendor_of_real_motion_is_foreseen() -> None:
    result = replay([Path(RECORDINGS or "") / "mrclam7.oracle.jsonl.gz"], DEFAULT, [0.3])
    (figures,) = result["scores"]
    assert figures["recall"] > 0.9
    assert figures["precision"] > 0.6
