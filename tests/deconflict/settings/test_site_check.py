import io
import tomllib
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deconflict.roles.service_commands import serving_problems
from deconflict.settings.site_check import check, site_report
from deconflict.settings.site_file import load
from ingest.frames.fitting import Method
from tests.helpers.made_site import HALL, MARKS, put, sound, written

EXAMPLES = Path(__file__).parents[3] / "examples"
READINGS = "vendors.1.maps.0.readings"


def checked(document: dict[str, Any], folder: Path) -> tuple[int, str]:
    out = io.StringIO()
    code = check(written(document, folder), out)
    return code, out.getvalue()


def test_a_valid_site_passes_and_shows_each_fit(tmp_path: Path) -> None:
    code, text = checked(sound(), tmp_path)
    assert code == 0
    assert text.startswith("PASSED\n")
    assert "works: 2 datums, 2 vendors, 1 own map" in text
    assert "\n\nacme: sends in the datums' own coordinates\n" in text
    assert "\n\nbolt: own map own on datum Hall\n" in text
    assert "method adjust, not mirrored, rotation 90.000 deg, translation (0.000, 0.000) m" in text
    assert "one unit is 1 m along x, 1 m along y; shear 0.000 deg" in text


def test_the_verdict_on_a_file_that_is_not_understood_comes_first(tmp_path: Path) -> None:
    code, text = checked(sound() | {"nmae": "Works"}, tmp_path)
    assert code == 2
    assert text.startswith("FAILED: the site file has problems:\n  nmae: there is no such key")


def test_what_devices_stand_for_is_listed_unless_all_are_robots(tmp_path: Path) -> None:
    document = put(put(sound(), "vendors.1.participant", "person"), "vendors.1.participants", {"robot": ["ab*"]})
    _, text = checked(put(document, "vendors.1.models.lift", {"participant": "driven"}), tmp_path)
    assert "\nbolt: people; model lift: driven vehicles; 1 UUID: robots\n" in text
    assert "people" not in checked(sound(), tmp_path)[1]


def test_an_example_shows_which_way_round_the_map_is_applied(tmp_path: Path) -> None:
    document = put(sound(), READINGS, {name: [100 + y, 50 - x] for name, (x, y) in MARKS.items()})
    _, text = checked(document, tmp_path)
    assert "its origin at (0.000, 0.000), yaw 0.0 deg on the map is at (50.000, -100.000), yaw 90.0 deg" in text
    assert "a robot at (112.500, 30.000), yaw 0.0 deg on the map is at (20.000, 12.500), yaw 90.0 deg" in text


def test_a_datum_in_degrees_shows_its_points_in_metres_and_how_yaw_is_converted(tmp_path: Path) -> None:
    _, text = checked(sound(), tmp_path)
    assert "x east, y north" in text
    (post,) = [line for line in text.splitlines() if line.startswith("  post")]
    assert post.split()[1:4] == ["42.3610000", "-71.0590000", "->"]
    assert [float(keyword) for keyword in post.split()[4:6]] == pytest.approx([82.38, 111.08], abs=0.01)
    assert "yaw 0 deg (north) becomes 90 deg" in text


def test_each_reference_point_shows_its_residual_with_it_and_without_it(tmp_path: Path) -> None:
    document = put(sound(), f"{READINGS}.gate", [24.4, -2.0])
    site = load(written(document, tmp_path))
    (judged,) = site_report(site).maps
    assert judged.fit
    _, text = checked(document, tmp_path)
    (gate,) = [line for line in text.splitlines() if line.startswith("  gate")]
    row = list(MARKS).index("gate")
    assert f"{judged.fit.residuals_m[row]:.3f} m" in gate
    assert f"{judged.fit.left_out_m[row]:.3f} m" in gate
    assert judged.fit.left_out_m[row] == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (f"{READINGS}.gate", [27.0, -2.0], "FAILS vendor bolt, map own: readings."),
        (READINGS, {"door": [0, 0], "dock": [9, 0], "pillar": [20, 0]}, "FAILS vendor bolt, map own: readings: the"),
        (
            READINGS,
            {name: list(place[::-1]) for name, place in MARKS.items()},
            "FAILS vendor bolt, map own: mirrored: the",
        ),
        ("vendors.1.maps.0.mirrored", True, "FAILS vendor bolt, map own: mirrored: found true"),
        ("datums.1.reference_points.0.x", -42.361, "FAILS datum Yard: reference_points.post: lies more than 20 km"),
    ],
    ids=["bad fit", "collinear", "mirrored", "not mirrored", "elsewhere"],
)
def test_a_bad_map_fails_with_its_key(path: str, value: Any, says: str, tmp_path: Path) -> None:
    code, text = checked(put(sound(), path, value), tmp_path)
    assert code == 2
    assert says in text
    assert text.startswith("FAILED: 1 to correct\nFAILS")


def test_a_file_that_does_not_load_fails_with_every_problem(tmp_path: Path) -> None:
    code, text = checked(put(sound(), "receiver.prt", 1), tmp_path)
    assert code == 2
    assert "receiver.prt: there is no such key; did you mean port?" in text


def test_two_points_fit_with_a_note_on_what_they_cannot_show(tmp_path: Path) -> None:
    document = put(sound(), READINGS, {"door": [0, 0], "dock": [1.1, -44.0]})
    (judged,) = site_report(load(written(document, tmp_path))).maps
    assert judged.fit
    assert judged.fit.method is Method.SIMILARITY
    assert np.isnan(judged.fit.left_out_m).all()
    code, text = checked(document, tmp_path)
    assert code == 0
    assert "NOTE one unit of the map is 0.909 m; if it is a map in metres, a reading is wrong" in text
    assert "NOTE two points can't show a wrong reading or a mirrored map" in text


def test_a_map_in_another_unit_has_no_note(tmp_path: Path) -> None:
    document = put(sound(), READINGS, {name: [1000 * y, -1000 * x] for name, (x, y) in MARKS.items()})
    code, text = checked(document, tmp_path)
    assert code == 0
    assert "one unit is 0.001 m along x" in text
    assert "  NOTE" not in text


def test_shared_places_are_listed_with_their_floors_and_service(tmp_path: Path) -> None:
    square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
    lift: dict[str, Any] = {"id": "lift-1", "kind": "lift", "datum": HALL, "polygon": square, "group": "lifts"}
    lift["floors"] = [{"datum": "yard", "polygon": square}]
    aisle = {"id": "a", "kind": "aisle", "datum": HALL, "polygon": square, "axis": [[0.0, 1.0], [2.0, 1.0]]}
    code, text = checked(sound() | {"resources": [lift], "zones": [aisle]}, tmp_path)
    assert code == 0
    assert "lift lift-1, lift-1, on Hall and Yard: 4.0 m2, capacity 1\n  service learned, 45 s at first" in text
    assert "single lane of 2.0 m" in text


@pytest.mark.parametrize(
    ("slip", "names"),
    [
        (
            lambda readings: readings | {"gate": [1000 * at for at in readings["gate"]]},
            "readings.gate: this reading seems",
        ),
        (
            lambda readings: readings | {"gate": readings["dock"], "dock": readings["gate"]},
            "dock and gate are exchanged",
        ),
        (
            lambda readings: readings | {"dock": readings["dock"][::-1]},
            "readings.dock: this reading has x and y exchanged",
        ),
        (
            lambda readings: readings | {"gate": [readings["gate"][0] + 3.3, 1.7]},
            "readings.gate: this reading is wrong",
        ),
    ],
    ids=["unit", "exchanged points", "exchanged axes", "wrong"],
)
def test_the_reading_that_is_wrong_is_named_and_no_other(slip: Any, names: str, tmp_path: Path) -> None:
    document = sound()
    right = document["vendors"][1]["maps"][0]["readings"]
    _, text = checked(put(document, READINGS, slip(right)), tmp_path)
    assert "FAILS vendor bolt, map own: readings" in text
    assert names in text
    assert "  NOTE" not in text, "nothing contradicts it"


def test_slips_of_units_and_secrets_are_found_before_the_service_starts(tmp_path: Path) -> None:
    document = put(sound(), "conflict", {"clearance_m": 30.0})
    document = put(document, "vendors.1.models.b1.envelope_m", [12.0, 8.0, 0.0])
    code, text = checked(document, tmp_path)
    assert code == 0
    assert "NOTE conflict.clearance_m = 30" in text
    assert "NOTE vendor bolt, model b1: an envelope of 12 x 8; is it in metres?" in text
    assert "NOTE datum Yard: its id 'yard' is no UUID" in text
    out = io.StringIO()
    secretive = put(document, "vendors.1.token", "env:NOT_SET_ANYWHERE")
    assert check(written(secretive, tmp_path), out, serving_problems) == 2
    assert "NOT_SET_ANYWHERE" in out.getvalue()


def test_the_example_of_latitude_and_longitude_on_a_floor_in_metres_passes() -> None:
    out = io.StringIO()
    assert check(EXAMPLES / "latitude_and_longitude.toml", out) == 0
    assert "48.1371000  11.5754000  ->      0.000     0.000" in out.getvalue()
    assert "yaw 0.0 deg on the map is at (19.998, 12.403), yaw 70.0 deg" in out.getvalue(), "north"


@pytest.mark.parametrize(("a", "b"), list(combinations(("door", "dock", "pillar", "gate", "office"), 2)))
def test_exchanged_readings_in_degrees_are_named_too(a: str, b: str, tmp_path: Path) -> None:
    example = tomllib.loads((EXAMPLES / "latitude_and_longitude.toml").read_text())
    readings = example["vendors"][0]["maps"][0]["readings"]
    readings[a], readings[b] = readings[b], readings[a]
    _, text = checked(example, tmp_path)
    (problem,) = (line for line in text.splitlines() if line.startswith("FAILS"))
    assert f"readings: {a} and {b} are exchanged" in problem


def test_of_four_points_in_a_rectangle_both_exchanges_that_explain_them_are_named(tmp_path: Path) -> None:
    example = tomllib.loads((EXAMPLES / "latitude_and_longitude.toml").read_text())
    readings = example["vendors"][0]["maps"][0]["readings"]
    del readings["office"]
    readings["door"], readings["pillar"] = readings["pillar"], readings["door"]
    _, text = checked(example, tmp_path)
    assert "not mirrored, unless door and pillar are exchanged, or dock and gate are exchanged" in text


def test_the_members_that_a_cluster_expects_are_stated(tmp_path: Path) -> None:
    document = put(sound(), "cluster", {"nats": ["nats://127.0.0.1:4222"], "engines": 2})
    assert (
        "cluster deconflict, expected members: all seen ingests, 2 engines, all seen faces"
        in checked(document, tmp_path)[1].splitlines()
    )


CLUSTER = {"nats": ["nats://127.0.0.1:4222"]}
HOOK = {"name": "fleet", "url": "http://127.0.0.1:9/", "secret": "env:X", "kinds": ["advice"]}
ANSWERING = {"name": "Ada", "role": "answer", "vendor": "acme", "token": "env:X"}
IGNORED: dict[str, tuple[Any, str]] = {
    "blackbox": ({"files": 10}, "blackbox: a cluster writes no black boxes; remove the section"),
    "vendors.0.verbs": (["go_around"], "verbs: a cluster asks nothing of single robots; remove the key"),
    "operator.people": ([ANSWERING], "role: a cluster gives no advice to answer; expected another role"),
    "webhooks": ([HOOK], "kinds: a cluster gives no advice to single robots; remove 'advice'"),
    "mqtt": ({"host": "hall", "kinds": ["advice"]}, "mqtt.kinds: a cluster gives no advice to single robots"),
}
"""By key, a value that has no effect in a cluster, and what is said of it."""


@pytest.mark.parametrize("key", IGNORED)
def test_a_key_that_a_cluster_ignores_is_refused_there(key: str, tmp_path: Path) -> None:
    value, problem = IGNORED[key]
    document = put(sound(), key, value)
    assert checked(document, tmp_path)[0] == 0
    code, text = checked(put(document, "cluster", CLUSTER), tmp_path)
    assert code == 2
    assert problem in text


def test_a_file_for_a_cluster_may_say_that_it_wants_neither(tmp_path: Path) -> None:
    document = put(put(sound(), "blackbox", {"enabled": False}), "vendors.0.verbs", [])
    assert checked(put(document, "cluster", CLUSTER), tmp_path)[0] == 0
