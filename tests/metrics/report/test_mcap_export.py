import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from tests.helpers.commands import run
from tests.metrics.replay.made_replays import log_of_a_crossing

Told = list[tuple[str, dict[str, Any], dict[str, Any]]]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder: Path = tmp_path_factory.mktemp("mcap")
    log = log_of_a_crossing(folder / "log.jsonl")
    out = folder / "out.mcap", folder / "again.mcap"
    arguments = ["replay", str(log), "--json", str(folder / "out.json"), "--mcap"]
    run(*arguments, out[0])
    subprocess.run([sys.executable, "-m", "deconflict", *arguments, str(out[1])], check=True)
    return out


def read(path: Path) -> Told:
    """Schema name, schema and message of each message."""
    with path.open("rb") as file:
        return [
            (schema.name, json.loads(schema.data), json.loads(message.data))
            for schema, _, message in make_reader(file).iter_messages()
            if schema
        ]


def test_every_message_matches_its_schema(exported: tuple[Path, Path]) -> None:
    found = read(exported[0])
    assert {name for name, _, _ in found} == {"foxglove.SceneUpdate", "foxglove.Log"}
    for _, schema, message in found:
        Draft202012Validator(schema).validate(message)
        assert message.keys() <= schema["properties"].keys()


def test_robots_are_drawn_where_they_are_and_advisories_are_logged(exported: tuple[Path, Path]) -> None:
    found = read(exported[0])
    scenes = [message for name, _, message in found if name == "foxglove.SceneUpdate"]
    first = min(scenes[0]["entities"], key=lambda scene: float(scene["cubes"][0]["pose"]["position"]["x"]))
    assert first["cubes"][0]["pose"]["position"]["x"] == pytest.approx(-12.0)
    assert len(first["lines"][0]["points"]) > 2
    logged = [message["message"] for name, _, message in found if name == "foxglove.Log"]
    assert logged[0].startswith("raised: ")
    assert logged[-1].startswith("cleared: ")


def test_the_same_log_gives_the_same_bytes(exported: tuple[Path, Path]) -> None:
    first, other = exported
    assert first.read_bytes() == other.read_bytes()
