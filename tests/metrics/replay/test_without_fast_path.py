"""The service works with the folder `ingest/fast_path` deleted."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.metrics.replay.made_replays import log_of_a_crossing

ROOT = Path(__file__).parents[3]
PACKAGES = ("deconflict_client", "ingest", "deconflict", "metrics")


def replayed(root: Path, log: Path, out: Path) -> tuple[dict[str, Any], bytes]:
    """The scores, without how long they took, and the advisories."""
    scores, advisories = out / "scores.json", out / "advisories.jsonl"
    command = [sys.executable, "-m", "deconflict", "replay", str(log), "--json", str(scores)]
    command += ["--advisories", str(advisories)]
    subprocess.run(command, check=True, cwd=root, env=os.environ | {"PYTHONPATH": str(root)})
    document = json.loads(scores.read_text())
    del document["speed_x_real_time"]
    return document, advisories.read_bytes()


@pytest.fixture
def slower(tmp_path: Path) -> Path:
    """A copy of the packages, compiled kernels included, without the fast path."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / "copy" / package)
    shutil.rmtree(tmp_path / "copy" / "ingest" / "fast_path")
    return tmp_path / "copy"


def test_a_replay_is_the_same_without_the_fast_path(slower: Path, tmp_path: Path) -> None:
    log = log_of_a_crossing(tmp_path / "log.jsonl")
    outs = [tmp_path / "fast", tmp_path / "slow"]
    for out in outs:
        out.mkdir()
    scores, advisories = replayed(ROOT, log, outs[0])
    assert advisories
    assert replayed(slower, log, outs[1]) == (scores, advisories)
