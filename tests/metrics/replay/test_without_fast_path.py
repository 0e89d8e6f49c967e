"""The service works with the folder `ingest/fast_path` deleted."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.commands import run
from tests.metrics.replay.made_replays import log_of_a_crossing

ROOT = Path(__file__).parents[3]
PACKAGES = ("deconflict_client", "ingest", "deconflict", "metrics")


def replayed(out: Path, replay: Callable[..., object]) -> tuple[dict[str, Any], bytes]:
    """The scores, without how long they took, and the advisories."""
    out.mkdir()
    scores, advisories = out / "scores.json", out / "advisories.jsonl"
    replay("--json", scores, "--advisories", advisories)
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
    command = [sys.executable, "-m", "deconflict", "replay", str(log)]
    environment = os.environ | {"PYTHONPATH": str(slower)}
    scores, advisories = replayed(tmp_path / "fast", partial(run, "replay", log))
    assert advisories
    assert replayed(
        tmp_path / "slow",
        lambda *outputs: subprocess.run([*command, *outputs], check=True, cwd=slower, env=environment),
    ) == (scores, advisories)
