"""What mypyc compiled tells what its source tells, to the last digit."""

import json
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from random import Random

import pytest

from benchmarks.replay import write_log
from tests.conftest import PACKAGES, PRODUCT
from tests.fuzz.mutation import JSON, mutated

MUTATED = 400


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quarter of a minute of the demo's vendors, and messages of theirs that were tampered with in between."""
    path, random = tmp_path_factory.mktemp("compiled") / "log.jsonl", Random(1)
    write_log(path, 12, 16.0)
    sound = path.read_text().splitlines()
    lines = list(enumerate(sound))
    for _ in range(MUTATED):
        at = random.randrange(40, len(sound))
        told = json.loads(sound[at])
        raw = mutated(json.dumps(told["message"]).encode(), random, JSON)
        if b"\n" not in raw:
            lines.append((at, f'{{"received":"{told["received"]}","message":{raw.decode(errors="replace")}}}'))
    path.write_text("\n".join(line for _, line in sorted(lines)))
    return path


def retold(log: Path, *through: str) -> tuple[list[str], int]:
    command = [sys.executable, "-m", *through, "tests.retold", str(log)]
    *told, compiled = subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=PRODUCT
    ).stdout.splitlines()
    return told, int(compiled)


@pytest.mark.skipif(
    not any(path for package in PACKAGES for path in (PRODUCT / package).rglob(f"*{EXTENSION_SUFFIXES[0]}")),
    reason="nothing is compiled: make compiled",
)
def test_what_is_compiled_tells_what_its_source_tells(log: Path) -> None:
    (told, compiled), (interpreted, none) = retold(log), retold(log, "benchmarks.interpreted")
    assert compiled > 0
    assert none == 0
    assert len({line for line in told if line.startswith("rule ")}) > 5, "a log without rejects proves less"
    assert told == interpreted
