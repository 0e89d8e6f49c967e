"""`site align` and `check --driven`: from a log to a map to paste, and the name of a wrong reading."""

import io
import json
import tomllib
from datetime import UTC, datetime
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deconflict.settings.importers.proposed_maps import proposed_maps
from deconflict.settings.site import Site
from deconflict.settings.site_check import check
from deconflict.settings.site_file import load, site_from_toml
from ingest.frames.frame_registry import fit_map
from tests.helpers.made_driving import ROUND, followed

HALL, OWN = "a0eebc99-9c0b-4ef8-bb6d-6bb9bd380a11", "b1eebc99-9c0b-4ef8-bb6d-6bb9bd380a22"
MARKS = {"west": (0.0, 0.0), "north": (5.0, 44.0), "far": (70.0, 42.0), "south": (70.0, -5.0)}
TURN_RAD, SHIFT_M, BEGAN_S = 0.7, (30.0, -12.0), 1_790_000_000
SITE = (
    f"""
name = "works"
[[datums]]
id = "{HALL}"
name = "Hall"
reference_points = {json.dumps([{"id": mark, "x": x, "y": y} for mark, (x, y) in MARKS.items()])}
[[vendors]]
name = "Alder"
[[vendors]]
name = "Idle"
[[vendors]]
name = "Birch"
""".replace('"id":', "id =")
    .replace('"x":', "x =")
    .replace('"y":', "y =")
)


def site_of(text: str) -> Site:
    return site_from_toml(text.encode(), Path("site.toml"))


def sent(x_m: float, y_m: float) -> tuple[float, float]:
    c, s = cos(TURN_RAD), sin(TURN_RAD)
    return c * x_m - s * y_m + SHIFT_M[0], s * x_m + c * y_m + SHIFT_M[1]


def messages(robot: int, points_m: Any) -> list[tuple[int, dict[str, Any]]]:
    """The robots with even numbers are Birch's, in its own frame."""
    uuid, own = f"1c0e7d6e-1111-4f6f-8000-0000000000{robot:02}", robot % 2 == 0
    vendor, datum = ("Birch", OWN) if own else ("Alder", HALL)
    first = {
        "uuid": uuid,
        "timestamp": stamp(0),
        "manufacturerName": vendor,
        "robotModel": "M",
        "robotSerialNumber": str(robot),
        "baseRobotEnvelope": {"x": 0.8, "y": 0.6, "z": 1.0},
    }
    found = [(0, first)]
    for t_s, (x_m, y_m) in enumerate(points_m.tolist()):
        x, y = sent(x_m, y_m) if own else (x_m, y_m)
        place = {"x": x, "y": y, "angle": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "planarDatum": datum}
        found.append(
            (t_s, {"uuid": uuid, "timestamp": stamp(t_s), "operationalState": "navigating", "location": place})
        )
    return found


def stamp(t_s: float) -> str:
    return datetime.fromtimestamp(BEGAN_S + t_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    driven_m = followed(ROUND, 12, 480, seed=1)
    driven_m += np.random.default_rng(3).normal(0.0, 0.05, driven_m.shape)
    lines = [line for robot in range(12) for line in messages(robot, driven_m[:, robot])]
    path = tmp_path_factory.mktemp("log") / "morning.jsonl"
    lines.sort(key=lambda line: line[0])
    path.write_text(
        "".join(json.dumps({"received": stamp(t_s + 0.05), "message": message}) + "\n" for t_s, message in lines)
    )
    return path


def test_a_map_to_paste_says_how_it_was_found(log: Path) -> None:
    text = proposed_maps([log], site_of(SITE))
    assert text.startswith("# Maps found from driving: morning.jsonl, 2026-09-21 14:13 to 2026-09-21 14:21 UTC.")
    assert "m driven in the lanes of Alder on Hall; usual distance from their lanes 0." in text
    assert "Uncertain (95 %) by 0." in text
    assert "Idle" not in text
    site = site_of(SITE + text)
    (vendor_map,) = site.vendors[-1].maps
    assert vendor_map.datum == OWN
    found_m = fit_map(vendor_map, site.datums[0]).transform(np.array([sent(*mark) for mark in MARKS.values()]))
    assert np.hypot(*(found_m - list(MARKS.values())).T).max() < 0.2


def test_a_floor_without_marks_gets_some_to_paste(log: Path) -> None:
    bare = "\n".join(line for line in SITE.splitlines() if "reference_points" not in line)
    text = proposed_maps([log], site_of(bare))
    (points,) = [line.removeprefix("# ") for line in text.splitlines() if "reference_points = " in line]
    marks = {point["id"] for point in tomllib.loads(points)["reference_points"]}
    site = site_of(bare.replace('name = "Hall"', f'name = "Hall"\n{points}') + text)
    assert set(site.vendors[-1].maps[0].readings) == marks


def test_check_names_the_reading_that_is_a_metre_off(log: Path, tmp_path: Path) -> None:
    readings = {mark: [*sent(*place)] for mark, place in MARKS.items() if mark in {"west", "far"}}
    readings["far"][0] += 1.0
    document = f'[[vendors.maps]]\ndatum = "{OWN}"\nsite_datum = "{HALL}"\n[vendors.maps.readings]\n'
    document += "".join(f"{mark} = {json.dumps(reading)}\n" for mark, reading in readings.items())
    path, out = tmp_path / "site.toml", io.StringIO()
    path.write_text(SITE + document)
    assert load(path)
    assert check(path, out, logs=[log]) == 0
    assert "the readings differ from it by 1." in out.getvalue()
    (note,) = [line for line in out.getvalue().splitlines() if "where driving puts it" in line]
    assert note.startswith("  NOTE the reading of far is ")


def test_a_vendor_that_drove_alone_is_told_what_helps(log: Path, tmp_path: Path) -> None:
    alone = tmp_path / "alone.jsonl"
    alone.write_text("".join(line + "\n" for line in log.read_text().splitlines() if HALL not in line))
    text = proposed_maps([alone], site_of(SITE))
    assert f"# Birch, datum {OWN}, 6 robots: not enough driving in common.\n# " in text
    assert "[[vendors.maps]]" not in text
