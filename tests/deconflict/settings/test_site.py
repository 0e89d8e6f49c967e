from pathlib import Path
from typing import Any

import jsonschema
import pytest

from deconflict.settings.site import DEFAULT, Site
from deconflict.settings.site_file import SiteError, fit_problems, load
from tests.helpers.made_site import HALL, put, sound, written

NIL = "00000000-0000-0000-0000-000000000000"
ROBOT = "1C0E7D6E-1111-4F6F-8000-000000000001"


def test_a_valid_file_is_read_as_written(tmp_path: Path) -> None:
    site = load(written(sound(), tmp_path))
    assert site.vendors[1].maps[0].readings["dock"] == (1.0, -40.0)
    assert site.vendors[1].models["b1"].offset_m == (1.1, 0.0)
    assert site.datums[1].reference_location == (42.36, -71.06)
    assert fit_problems(site) == []


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_file_of_an_editor_of_windows_is_read(encoding: str, end: str, tmp_path: Path) -> None:
    text = written(sound() | {"name": "Größe ✓"}, tmp_path).read_text(encoding="utf-8")
    (tmp_path / "other.toml").write_bytes(text.replace("\n", end).encode(encoding))
    assert load(tmp_path / "other.toml") == load(tmp_path / "site.toml")


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "latin-1", "cp1252"])
def test_a_file_of_another_encoding_is_refused_with_what_to_do(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_bytes('name = "Größe"\n'.encode(encoding))
    with pytest.raises(SiteError) as refused:
        load(tmp_path / "site.toml")
    (problem,) = refused.value.problems
    assert problem.endswith("; save it as UTF-8")


def test_datum_ids_are_compared_without_case(tmp_path: Path) -> None:
    document = put(sound(), "datums.0.id", HALL.upper())
    document = put(document, "vendors.1.maps.0.site_datum", HALL.title())
    assert load(written(document, tmp_path)).datums[0].id == HALL


def test_a_datum_may_be_spelt_in_several_ways_in_one_site_file(tmp_path: Path) -> None:
    own, plain = "0d9a3f6e-7a51-4c52-9f0e-2b1a6c3d4e5f", "0D9A3F6E7A514C529F0E2B1A6C3D4E5F"
    names = (own, HALL.replace("-", "")), (plain, f"urn:uuid:{HALL}")
    fields = sound()["vendors"][1]["maps"][0]
    maps = [fields | {"datum": datum, "site_datum": site_datum} for datum, site_datum in names]
    site = load(written(put(sound(), "vendors.1.maps", maps), tmp_path))
    assert [(each.datum, each.site_datum) for each in site.vendors[1].maps] == [(own, HALL)] * 2
    maps[1]["readings"] = {**maps[1]["readings"], "dock": [2.0, -40.0]}
    assert_told(put(sound(), "vendors.1.maps", maps), f"vendors.bolt.maps.{plain}.datum: '{own}' is given by", tmp_path)


def test_an_empty_file_gives_the_defaults(tmp_path: Path) -> None:
    assert load(written({}, tmp_path)) == DEFAULT
    assert fit_problems(DEFAULT) == []


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("datum", [], "datum: there is no such key; did you mean datums?"),
        ("conflict.clearence_m", 0.5, "conflict.clearence_m: there is no such key; did you mean clearance_m?"),
        ("vendors.1.maps.0.reading", {}, "vendors.bolt.maps.own.reading: there is no such key; did you mean readings?"),
        (
            "vendors.1.models.b1.offset",
            [0, 0],
            "vendors.bolt.models.b1.offset: there is no such key; did you mean offset_m?",
        ),
        ("store.zzz", 1, "store.zzz: there is no such key; expected one of directory"),
        (
            "vendors.1.maps.0.site_datum",
            None,
            "vendors.bolt.maps.own.site_datum: is missing; expected The site's datum",
        ),
        ("vendors.0.name", None, "vendors[0].name: is missing; expected Short name in metrics and advisories"),
        (
            "conflict.clearance_m",
            -0.1,
            "conflict.clearance_m: input should be greater than or equal to 0; found '-0.1'",
        ),
        ("conflict.clearance_m", "wide", "conflict.clearance_m: input should be a valid number; found 'wide'"),
        ("conflict.clearance_m", "0.3", "conflict.clearance_m: input should be a valid number; found '0.3'"),
        ("conflict.clearance_m", True, "conflict.clearance_m: input should be a valid number; found 'True'"),
        ("conflict.horizon_s", float("inf"), "conflict.horizon_s: input should be a finite number; found 'inf'"),
        ("conflict.urgent_s", 1e300, "conflict.urgent_s: input should be less than or equal to 31622400"),
        ("engine.tick_s", 1e300, "engine.tick_s: input should be less than or equal to 2; found '1e+300'"),
        ("engine.tick_s", 1e-9, "engine.tick_s: input should be greater than or equal to 0.01; found '1e-09'"),
        ("receiver.port", 70000, "receiver.port: input should be less than or equal to 65535; found '70000'"),
        ("datums.0.coordinates", "feet", "datums.Hall.coordinates: input should be 'metres', 'latlon' or"),
        ("datums.0.reference_points.2.x", "a", "datums.Hall.reference_points.pillar.x: input should be a valid number"),
        ("vendors.1.maps.0.readings.dock", [1.0], "vendors.bolt.maps.own.readings.dock[1]: is missing"),
        ("reading.default_envelope_m", [1, 0, 0], "reading.default_envelope_m[1]: input should be greater than 0"),
    ],
)
def test_a_wrong_key_is_named_with_what_was_found_and_expected(
    path: str, value: Any, says: str, tmp_path: Path
) -> None:
    assert_told(put(sound(), path, value), says, tmp_path)


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("datums.1.id", HALL.upper(), f"datums.Yard.id: '{HALL}' is given by datums.Hall.id too"),
        ("datums.1.id", HALL.replace("-", ""), f"datums.Yard.id: '{HALL}' is given by datums.Hall.id too"),
        ("datums.0.id", "", "datums.Hall.id: '' names no datum"),
        ("datums.1.id", NIL, f"datums.Yard.id: '{NIL}' names no datum"),
        ("datums.0.reference_points.1.id", "door", "datums.Hall.reference_points[1].id: 'door' is given by"),
        ("datums.1.reference_location", None, "datums.Yard.reference_location: is missing"),
        ("datums.1.reference_location", [-171.06, 42.36], "datums.Yard.reference_location: found [-171.06, 42.36]"),
        ("vendors.1.name", "acme", "vendors[1].name: 'acme' is given by vendors[0].name too"),
        (
            "vendors.0.manufacturers",
            ["BOLT robotics"],
            "vendors.bolt.manufacturers[0]: 'bolt robotics' is given by vendors.acme",
        ),
        (
            "vendors.0.manufacturers",
            ["ACME", "Bolt"],
            "vendors.bolt.name: 'bolt' is given by vendors.acme.manufacturers[1] too",
        ),
        (
            "vendors.1.robots",
            [ROBOT],
            "vendors.bolt.robots[0]: '1c0e7d6e-1111-4f6f-8000-000000000001' is given by vendors.acme",
        ),
        (
            "vendors.1.participants",
            {"person": ["a1*", "b2"], "driven": ["B2"]},
            "vendors.bolt.participants.driven: 'b2' is given by vendors.bolt.participants.person too",
        ),
        (
            "vendors.1.participants",
            {"person": ["*a1"]},
            "vendors.bolt.participants.person: found '*a1'; expected a UUID",
        ),
        ("vendors.1.participants", {"persn": ["a1"]}, "vendors.bolt.participants.persn"),
        (
            "vendors.1.dial",
            ["10.0.0.7:3000"],
            "vendors.bolt.dial[0]: found '10.0.0.7:3000'; expected ws://HOST:PORT/PATH",
        ),
        (
            "vendors.1.maps.0.site_datum",
            "yrd",
            "vendors.bolt.maps.own.site_datum: no datum has the id 'yrd'; did you mean yard?",
        ),
        (
            "vendors.1.maps.0.readings.dok",
            [1, 1],
            "vendors.bolt.maps.own.readings.dok: datum 'Hall' has no such point; did you mean",
        ),
        (
            "vendors.1.maps.1",
            {"datum": "OWN", "site_datum": HALL, "readings": {}},
            "vendors.bolt.maps.OWN.datum: 'own' is given by",
        ),
        ("conflict.confirm", [3, 2], "conflict.confirm: [3, 2] asks for more looks than it counts"),
        ("conflict.critical_s", 6.0, "conflict.critical_s: found 6.0; expected at most conflict.warning_s = 5.0"),
        ("conflict.horizon_s", 20.0, "conflict.horizon_s: found 20.0; expected at most reading.horizon_s = 10.0"),
        ("reading.quiet_after_s", 90.0, "reading.quiet_after_s: found 90.0; expected at most reading.silent_after_s"),
        ("reading.forget_after_s", 10.0, "reading.silent_after_s: found 60.0; expected at most reading.forget_after_s"),
        ("recorder.total_bytes", 1000, "recorder.segment_bytes: found 67108864; expected at most recorder.total_bytes"),
        ("receiver.dial_backoff_s", [9.0, 3.0], "receiver.dial_backoff_s[0]: found 9.0; expected at most"),
        ("operator.port", 3000, "operator.port: 3000 is receiver.port too; set another"),
    ],
)
def test_keys_that_contradict_each_other_are_named(path: str, value: Any, says: str, tmp_path: Path) -> None:
    assert_told(put(sound(), path, value), says, tmp_path)


SQUARE = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
DOCK = {"id": "d", "kind": "dock", "datum": HALL, "polygon": SQUARE}
AISLE = {"id": "a", "kind": "aisle", "datum": HALL, "polygon": SQUARE, "axis": [[0.0, 1.0], [2.0, 1.0]]}
RACK = {"kind": "rack", "floor": HALL, "outline_m": SQUARE}


@pytest.mark.parametrize(
    ("section", "place", "says"),
    [
        ("resources", DOCK | {"datum": "attic"}, "resources.d.datum: no datum has the id 'attic'"),
        ("resources", DOCK | {"polygon": [SQUARE[0], SQUARE[2], *SQUARE[1:]]}, "resources.d.polygon: self-inter"),
        ("resources", DOCK | {"polygon": [[0.0, 0.0]] * 3}, "resources.d.polygon: "),
        ("resources", DOCK | {"floors": [{"datum": "yard", "polygon": SQUARE}]}, "resources.d.floors: a dock is on"),
        ("zones", {key: AISLE[key] for key in AISLE if key != "axis"}, "zones.a.axis: is missing"),
        ("zones", AISLE | {"kind": "door"}, "zones.a.axis: a door has none"),
        ("zones", AISLE | {"axis": [[1.0, 1.0], [1.0, 1.0]]}, "zones.a.axis: both ends are at [1.0, 1.0]"),
        ("obstacles", RACK | {"floor": "attic"}, "obstacles[0].floor: no datum has the id 'attic'"),
        ("obstacles", RACK | {"outline_m": [[0.0, 0.0]] * 3}, "obstacles[0].outline_m: "),
        ("obstacles", RACK | {"kind": "rock"}, "obstacles[0].kind: input should be 'rack', 'wall' or 'machine'"),
        ("zones", AISLE | {"capacity": 0}, "zones.a.capacity: input should be greater than or equal to 1"),
    ],
)
def test_a_wrong_place_is_named_with_what_to_change(
    section: str, place: dict[str, Any], says: str, tmp_path: Path
) -> None:
    with pytest.raises(SiteError) as error:
        load(written(sound() | {section: [place]}, tmp_path))
    assert any(problem.startswith(says) for problem in error.value.problems), error.value.problems


def test_an_obstacle_of_a_site_with_several_floors_needs_its_floor(tmp_path: Path) -> None:
    document = put(sound(), "datums.1", {"id": "yard", "name": "Yard"}) | {"obstacles": [RACK | {"floor": ""}]}
    with pytest.raises(SiteError, match=rf"obstacles\[0\].floor: is missing; expected one of {HALL}, yard"):
        load(written(document, tmp_path))


def test_a_resource_and_a_zone_share_no_id(tmp_path: Path) -> None:
    document = sound() | {"resources": [DOCK], "zones": [AISLE | {"id": "d"}]}
    with pytest.raises(SiteError, match=r"zones\.d.id: 'd' is given by resources\.d.id too"):
        load(written(document, tmp_path))


def test_every_problem_is_reported_at_once(tmp_path: Path) -> None:
    document = put(put(sound(), "conflict.clearance_m", -1), "receiver.prt", 1)
    with pytest.raises(SiteError) as caught:
        load(written(document, tmp_path))
    assert len(caught.value.problems) == 2


def test_a_missing_file_and_one_that_is_not_toml_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    with pytest.raises(SiteError, match="can't be read"):
        load(path)
    path.write_text("name = \n")
    with pytest.raises(SiteError, match=r"is not TOML: .*line 1"):
        load(path)


def test_ports_that_the_system_chooses_may_both_be_0(tmp_path: Path) -> None:
    document = put(put(sound(), "receiver.port", 0), "operator.port", 0)
    assert load(written(document, tmp_path)).operator.port == 0


def test_readings_without_a_fit_load_but_are_a_problem(tmp_path: Path) -> None:
    document = put(sound(), "vendors.1.maps.0.readings", {"door": [0, 0]})
    site = load(written(document, tmp_path))
    assert fit_problems(site) == [
        "vendor bolt, map own: readings: readings of at least two reference points are needed, found 1"
    ]


def test_reference_points_with_latitude_and_longitude_swapped_are_a_problem(tmp_path: Path) -> None:
    document = put(sound(), "datums.1.reference_points.0", {"id": "post", "x": -71.059, "y": 42.361})
    (problem,) = fit_problems(load(written(document, tmp_path)))
    assert problem.startswith("datum Yard: reference_points.post: lies more than 20 km from reference_location")


def test_the_json_schema_accepts_what_the_loader_accepts_and_describes_each_field() -> None:
    schema = Site.model_json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(sound(), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(put(sound(), "conflict.clearance", 1.0), schema)
    undescribed = [
        f"{section}.{name}"
        for section, row in schema["$defs"].items()
        for name, field in row["properties"].items()
        if not field.get("description")
    ]
    assert undescribed == []


def assert_told(document: dict[str, Any], says: str, folder: Path) -> None:
    with pytest.raises(SiteError) as caught:
        load(written(document, folder))
    assert [problem for problem in caught.value.problems if problem.startswith(says)], caught.value.problems
    assert says in str(caught.value)
