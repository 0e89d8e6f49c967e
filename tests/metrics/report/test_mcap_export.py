import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Model, Trailers, Vendor
from metrics.report.mcap_export import McapExport
from tests.helpers.commands import run
from tests.helpers.saying import identity, robot, status
from tests.metrics.replay.made_replays import log_of_a_crossing

NOW_S = 1_792_000_000.0
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


def test_shapes_and_trailers_are_drawn(tmp_path: Path) -> None:
    models = {
        "A1": Model(shape="circle", diameter_m=0.8),
        "A2": Model(footprint_m=((1.0, 0.0), (-1.0, 0.5), (-1.0, -0.5))),
        "A3": Model(trailers=Trailers(count=3, length_m=1.2, width_m=0.8, hitch_m=1.5)),
    }
    fleet = fleet_of(Site(vendors=(Vendor(name="Alder", models=models),)), Measures())
    for model in models:
        fleet.receive(identity(model, NOW_S, robotModel=model), NOW_S, Connection(1))
        fleet.receive(status(model, NOW_S, 5.0), NOW_S, Connection(1))
    with (tmp_path / "shapes.mcap").open("wb") as out:
        export = McapExport(out)
        export.add_batch(NOW_S, fleet.next_batch(NOW_S))
        export.finish()
    ((_, schema, message),) = read(tmp_path / "shapes.mcap")
    Draft202012Validator(schema).validate(message)
    kinds = ("cubes", "cylinders", "triangles")
    drawn = {entity["id"]: {kind: entity[kind] for kind in kinds if entity[kind]} for entity in message["entities"]}
    (cylinder,) = drawn[robot("A1")]["cylinders"]
    assert (cylinder["pose"]["position"]["x"], cylinder["size"]) == (5.0, {"x": 0.8, "y": 0.8, "z": 0.4})
    (prism,) = drawn[robot("A2")]["triangles"]
    assert {point["x"] for point in prism["points"]} == {4.0, 6.0}
    assert [cube["pose"]["position"]["x"] for cube in drawn[robot("A3")]["cubes"]] == [5.0, 3.5, 2.0, 0.5]
