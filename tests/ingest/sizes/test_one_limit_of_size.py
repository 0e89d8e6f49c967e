"""One limit of size, whatever language states it: drawn over language, field, unit and size."""

from collections.abc import Callable
from math import pi
from typing import Any

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.repeat_status import load as load_fast_path
from ingest.fleet.robot import Robot
from ingest.frames.frame_registry import FrameRegistry
from ingest.settings import Datum, Model, Reading, Vendor
from ingest.sizes.model_sizes import MOST_EXPLAINED, ModelSizes
from ingest.sizes.stated_bodies import StatedBody, read_body
from ingest.sizes.stated_loads import MOST_NOTES
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL, identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, fleet

LIMIT_M = 30.0
UNITS = {"centimetres": 100.0, "millimetres": 1000.0}
DATUMS = (Datum(id=HALL, name="Hall"), Datum(id=vda_saying.MAP, name="Other hall"))
Sides = tuple[float, float, float]
"""Length, width and height."""


def of_massrobotics(of: Fleet, sides: Sides, name: str = "A-1", **keys: Any) -> Robot:
    size = dict(zip("xyz", sides, strict=True))
    report = identity(name, NOW_S, manufacturerName="KIT", robotModel="Carrier", baseRobotEnvelope=size, **keys)
    assert of.receive(report, NOW_S, LINE) is None
    assert of.receive(status(name, NOW_S), NOW_S, LINE) is None
    return of.robots[robot(name)]


def of_vda(of: Fleet, sides: Sides, serial: str = "0001", loads: Any = None, **keys: Any) -> Robot:
    length, width, height = sides
    parameters = {"length": length, "width": width, "heightMax": height, "speedMax": 1.0}
    report = vda_saying.factsheet(NOW_S, serialNumber=serial, physicalParameters=parameters, **keys)
    assert of.receive(report, NOW_S, vda_saying.line("factsheet", serial)) is None
    report = vda_saying.state(NOW_S, serialNumber=serial, loads=loads or [])
    assert of.receive(report, NOW_S, vda_saying.line("state", serial)) is None
    return next(each for each in of.robots.values() if each.serial == serial)


def of_iso(of: Fleet, sides: Sides, **keys: Any) -> Robot:
    length, width, height = sides
    report = iso_saying.identity(NOW_S, "KIT", imrFootprint=square(length, width), imrHeight=height, **keys)
    assert of.receive(report, NOW_S, iso_saying.line("identity")) is None
    assert of.receive(iso_saying.odometry(NOW_S), NOW_S, iso_saying.line("odometry")) is None
    return of.robots[iso_saying.ROBOT]


LANGUAGES: dict[str, Callable[..., Robot]] = {"massrobotics": of_massrobotics, "vda5050": of_vda, "iso21423": of_iso}


def square(length: float, width: float, x: float = 0.0) -> list[dict[str, float]]:
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return [{"x": x + a * length / 2, "y": b * width / 2} for a, b in corners]


def sides_of(of: Robot) -> tuple[float, float]:
    assert of.forecast is not None
    return of.forecast.length_m, of.forecast.width_m


def rules_of(of: Robot) -> set[str]:
    return {rule for rule in of.deviations if rule.startswith(("size-", "load-"))}


def notes_of(floor: Fleet, of: Robot) -> str:
    return " ".join(fleet_report.robot_document(floor, of, NOW_S)["sizes"])


LENGTHS = st.one_of(st.floats(0.01, LIMIT_M), st.floats(LIMIT_M, 5000.0), st.floats(5000.0, 1e308))
BODIES = st.tuples(st.floats(0.4, 3.0), st.floats(0.4, 2.0), st.floats(0.2, 2.0))


@given(st.sampled_from(sorted(LANGUAGES)), LENGTHS, LENGTHS, LENGTHS)
@example("massrobotics", LIMIT_M, LIMIT_M, LIMIT_M)
@example("vda5050", 1e308, 1e308, 1e308)
@example("iso21423", 1e308, 0.5, 0.0)
def test_no_size_loses_a_robot_and_none_is_beyond_the_limit(
    language: str, length: float, width: float, height: float
) -> None:
    floor = fleet(datums=DATUMS)
    read = LANGUAGES[language](floor, (length, width, height))
    sides_m = sides_of(read)
    assert max(sides_m) <= LIMIT_M * (1 + 1e-12)
    assert (rules_of(read) != set()) == (max(length, width, height) > LIMIT_M)
    for stated, side_m in zip((length, width), sides_m, strict=True):
        if "size-in-other-unit" not in rules_of(read):
            assert side_m == pytest.approx(min(stated, LIMIT_M), rel=1e-12), "neither shrunk nor grown"
    if max(length, width, height) <= LIMIT_M and language != "iso21423":
        assert sides_m == (length, width), "as stated, to the last bit"


@given(st.sampled_from(sorted(LANGUAGES)), st.sampled_from(sorted(UNITS)), BODIES)
def test_an_impossible_size_alone_stands_at_the_limit_and_is_named(language: str, unit: str, body: Sides) -> None:
    stated = tuple(side_m * UNITS[unit] for side_m in body)
    assume(min(stated[:2]) > LIMIT_M)
    floor = fleet(datums=DATUMS)
    read = LANGUAGES[language](floor, stated)
    assert sides_of(read) == pytest.approx((LIMIT_M, LIMIT_M))
    assert "size-over-limit" in rules_of(read)
    assert f"{stated[0]:g} x {stated[1]:g}" in notes_of(floor, read)
    assert "reading.largest_body_m = 30" in notes_of(floor, read)


@given(st.sampled_from(sorted(LANGUAGES)), st.sampled_from(sorted(UNITS)), BODIES, st.sampled_from(("vendor", "model")))
def test_what_the_site_file_says_of_a_vendors_robots_shows_the_unit(
    language: str, unit: str, body: Sides, where: str
) -> None:
    stated = tuple(side_m * UNITS[unit] for side_m in body)
    assume(max(stated[:2]) > LIMIT_M)
    if where == "vendor":
        vendor = Vendor(name="KIT", default_envelope_m=body)
    else:
        vendor = Vendor(name="KIT", models=dict.fromkeys(("Carrier", "A1"), Model(loaded_envelope_m=body)))
    floor = fleet(vendor, datums=DATUMS)
    read = LANGUAGES[language](floor, stated, **({"imrModel": "A1"} if language == "iso21423" else {}))
    assert sides_of(read) == pytest.approx(body[:2])
    assert rules_of(read) == {"size-in-other-unit"}
    assert unit in notes_of(floor, read)


@given(st.sampled_from(("massrobotics", "vda5050")), st.sampled_from(sorted(UNITS)), BODIES, st.booleans())
def test_another_robot_of_the_model_shows_the_unit_before_and_after(
    language: str, unit: str, body: Sides, is_before: bool
) -> None:
    stated = tuple(side_m * UNITS[unit] for side_m in body)
    assume(min(stated[:2]) > LIMIT_M)
    floor, say = fleet(datums=DATUMS), LANGUAGES[language]
    names = ("A-1", "A-2") if language == "massrobotics" else ("0001", "0002")
    if is_before:
        say(floor, body, names[0])
    read = say(floor, stated, names[1])
    if not is_before:
        assert sides_of(read) == pytest.approx((LIMIT_M, LIMIT_M))
        floor.next_batch(NOW_S)
        say(floor, body, names[0])
        assert len(floor.next_batch(NOW_S)) == 2, "the explained robot has another forecast"
    assert sides_of(read) == pytest.approx(body[:2])
    assert unit in notes_of(floor, read)


@pytest.mark.parametrize(
    "keys",
    [
        {"agvGeometry": {"envelopes2d": [{"set": "a", "polygonPoints": square(1.2, 0.8)}]}},
        {"agvGeometry": {"envelopes2d": [{"polygonPoints": square(size, size)} for size in (5.0, 1.2)]}},
        {"loadSpecification": {"loadSets": [{"loadDimensions": {"length": 1.2, "width": 0.8}}]}},
        {"loadSpecification": {"loadSets": [{"loadDimensions": 7}, {}, None, {"loadDimensions": {"length": 10**400}}]}},
        {"loadSpecification": "none"},
    ],
    ids=["an outline", "two outlines", "a load", "odd loads", "no loads"],
)
def test_other_figures_of_a_factsheet_show_its_unit(keys: dict[str, Any]) -> None:
    floor = fleet(datums=DATUMS)
    read = of_vda(floor, (1200.0, 800.0, 300.0), **keys)
    is_shown = "length" in str(keys) and "10000" not in str(keys)
    is_outlined = "agvGeometry" in keys
    assert max(sides_of(read)) == pytest.approx(1.2 if is_shown or is_outlined else LIMIT_M)


@given(st.sampled_from(sorted(UNITS)))
def test_an_outline_in_another_unit_is_converted_as_a_shape(unit: str) -> None:
    triangle = [{"x": x * UNITS[unit], "y": y * UNITS[unit]} for x, y in ((1.0, 0.0), (-0.5, 0.4), (-0.5, -0.4))]
    read = of_vda(fleet(datums=DATUMS), (1.5, 0.8, 0.5), agvGeometry={"envelopes2d": [{"polygonPoints": triangle}]})
    assert sides_of(read) == pytest.approx((1.5, 0.8))
    assert read.forecast is not None
    assert read.forecast.shape is not None
    assert read.forecast.shape.size_m == pytest.approx((1.5, 0.8))
    assert rules_of(read) == {"size-in-other-unit"}


def test_an_impossible_outline_leaves_the_length_and_width_beside_it() -> None:
    outline = {"envelopes2d": [{"polygonPoints": square(1.2, 0.8, 5000.0)}]}
    floor = fleet(datums=DATUMS)
    read = of_vda(floor, (1.2, 0.8, 0.5), agvGeometry=outline)
    assert (sides_of(read), rules_of(read)) == ((1.2, 0.8), {"size-over-limit"})
    assert "physicalParameters holds instead" in notes_of(floor, read)


def test_cargo_in_metres_shows_the_unit_of_a_robot_and_cargo_in_the_same_unit_does_not() -> None:
    for cargo, sides_m in (({"x": 1.0, "y": 0.6}, (1.2, 0.8)), ({"x": 1000, "y": 600}, (LIMIT_M, LIMIT_M))):
        read = of_massrobotics(fleet(datums=DATUMS), (1200.0, 800.0, 300.0), cargoMaxVolume=cargo)
        assert sides_of(read) == pytest.approx(sides_m)


def test_a_side_in_another_unit_than_the_other_side_is_converted() -> None:
    read = of_massrobotics(fleet(datums=DATUMS), (1200.0, 0.8, 0.3))
    assert (sides_of(read), rules_of(read)) == ((1.2, 0.8), {"size-in-other-unit"})


def test_a_height_in_another_unit_is_converted() -> None:
    read = of_iso(fleet(datums=DATUMS), (1.2, 0.8, 190.0))
    assert read.forecast is not None
    assert read.forecast.top_m == 1.9
    assert rules_of(read) == {"size-in-other-unit"}


@given(st.floats(-1e308, 1e308), st.floats(0.1, 5.0))
def test_an_impossible_offset_is_bounded_and_the_robot_is_still_where_it_says(x: float, length: float) -> None:
    floor = fleet(datums=DATUMS)
    footprint = square(length, 1.0, x)
    assume(footprint[0]["x"] > footprint[1]["x"])
    report = iso_saying.identity(NOW_S, imrFootprint=footprint)
    assert floor.receive(report, NOW_S, iso_saying.line("identity")) is None
    floor.receive(iso_saying.odometry(NOW_S), NOW_S, iso_saying.line("odometry"))
    read = floor.robots[iso_saying.ROBOT]
    assert read.forecast is not None
    assert read.size is not None
    (dx, _), length_m = read.size.body.offset_m, read.forecast.length_m
    assert abs(dx) <= LIMIT_M
    if read.size.rules:
        assert length_m == pytest.approx(LIMIT_M)
        assert dx - length_m / 2 <= 1e-9
        assert dx + length_m / 2 >= -1e-9


def load(size: Sides, x: float = 0.0, y: float = 0.0, z: float = 0.2, **keys: Any) -> dict[str, Any]:
    place = {"x": x, "y": y, "z": z}
    return {"boundingBoxReference": place | keys, "loadDimensions": dict(zip(LOAD_KEYS, size, strict=True))}


LOAD_KEYS = ("length", "width", "height")
CARRIER: Sides = (1.1, 0.6, 1.5)


@given(
    st.lists(st.tuples(LENGTHS, LENGTHS, LENGTHS), max_size=3),
    st.floats(-1e308, 1e308),
    st.floats(-1e308, 1e308),
    st.floats(-pi, pi),
)
def test_no_load_loses_a_state_or_makes_a_body_beyond_the_limit(
    sizes: list[Sides], x: float, y: float, theta: float
) -> None:
    floor = fleet(datums=DATUMS)
    read = of_vda(floor, CARRIER, loads=[load(size, x, y, theta=theta) for size in sizes])
    assert read.seen is not None
    for side_m, body_m in zip(sides_of(read), CARRIER, strict=False):
        assert body_m <= side_m * (1 + 1e-9)
        assert side_m <= LIMIT_M * (1 + 1e-9)
    largest = max((abs(value) for size in sizes for value in (*size, x, y)), default=0.0)
    if largest > LIMIT_M:
        assert rules_of(read) & {"load-over-limit", "load-in-other-unit"}
        assert "reading.largest_body_m" in notes_of(floor, read)


@given(st.sampled_from(sorted(UNITS)), st.floats(0.4, 2.0), st.floats(0.4, 2.0), st.floats(0.05, 1.0))
def test_a_load_in_another_unit_is_as_large_as_it_is(unit: str, length_m: float, width_m: float, top_m: float) -> None:
    stated = length_m * UNITS[unit], width_m * UNITS[unit], top_m * UNITS[unit]
    assume(min(stated[:2]) > LIMIT_M)
    read = of_vda(fleet(datums=DATUMS), CARRIER, loads=[load(stated)])
    assert sides_of(read) == pytest.approx((max(length_m, 1.1), max(width_m, 0.6)))
    assert rules_of(read) == {"load-in-other-unit"}


@given(st.sampled_from(sorted(UNITS)), st.floats(0.8, 2.0), st.floats(0.7, 2.0))
@example("millimetres", 1.2, 0.8)
def test_a_size_in_place_of_a_place_puts_the_load_in_the_middle(unit: str, length_m: float, width_m: float) -> None:
    """Seen in the field: the load's box in millimetres stands where its centre belongs."""
    place = length_m * UNITS[unit], width_m * UNITS[unit]
    read = of_vda(fleet(datums=DATUMS), CARRIER, loads=[load((length_m, width_m, 0.2), *place, 200.0)])
    assert read.forecast is not None
    assert sides_of(read) == pytest.approx((max(length_m, 1.1), max(width_m, 0.6)))
    assert read.forecast.knots[0][1:3] == pytest.approx((0.0, 0.0))
    assert rules_of(read) == {"load-in-other-unit"}


@given(st.floats(31.0, 300.0), st.floats(-300.0, 300.0))
@example(60.0, 40.0)
def test_a_place_in_millimetres_is_where_the_robot_is(x: float, y: float) -> None:
    read = of_vda(fleet(datums=DATUMS), CARRIER, loads=[load((1.2, 0.8, 0.2), x, y, 20.0)])
    length_m, width_m = sides_of(read)
    assert length_m <= 1.1 / 2 + 1.2 / 2 + 0.55, "the load's middle is on the robot"
    assert width_m <= 0.6 / 2 + 0.8 / 2 + 0.3
    assert rules_of(read) == {"load-in-other-unit"}


def test_the_robot_stays_as_it_is_under_an_impossible_load() -> None:
    read = of_vda(fleet(datums=DATUMS), CARRIER, loads=[load((1e6, 1e6, 1.0))])
    assert sides_of(read) == pytest.approx((LIMIT_M, LIMIT_M))
    of = fleet(datums=DATUMS)
    read = of_vda(of, CARRIER, loads=[load((1e6, 1e6, 1.0))])
    of.receive(vda_saying.state(NOW_S + 1, loads=[]), NOW_S + 1, vda_saying.line("state"))
    assert sides_of(read) == CARRIER[:2]
    assert notes_of(of, read) == ""


def test_a_changed_limit_holds_at_once_for_robots_that_are_known() -> None:
    of = fleet(datums=DATUMS)
    read = of_massrobotics(of, (40.0, 5.0, 3.0))
    assert sides_of(read) == (30.0, 5.0)
    for limit_m, length_m in ((50.0, 40.0), (35.0, 35.0), (30.0, 30.0)):
        of.reconfigure(VendorRegistry(()), FrameRegistry(DATUMS, ()), Reading(largest_body_m=limit_m))
        assert sides_of(read) == (length_m, 5.0)
        assert bool(notes_of(of, read)) == (length_m < 40.0)


def test_a_robot_that_left_is_not_brought_back_by_another_of_its_model() -> None:
    of = fleet(datums=DATUMS, forget_after_s=100.0)
    of_massrobotics(of, (1200.0, 800.0, 0.0), "A-2")
    of.next_batch(NOW_S + 200)
    assert robot("A-2") not in of.robots
    of_massrobotics(of, (1.2, 0.8, 0.0), "A-1")
    assert len(of.next_batch(NOW_S + 200)) <= 1
    assert robot("A-2") not in of.robots


def test_the_fast_path_reads_robots_at_the_limit_alike() -> None:
    plain, fast = fleet(datums=DATUMS), fleet(datums=DATUMS)
    fast.use(load_fast_path())
    batches = []
    for of in (plain, fast):
        of_massrobotics(of, (1200.0, 800.0, 300.0), "A-1")
        for step in range(1, 6):
            assert of.receive(status("A-1", NOW_S + step, step / 2), NOW_S + step, LINE) is None
        of_massrobotics(of, (1.2, 0.8, 0.3), "A-2")
        for step in range(6, 12):
            assert of.receive(status("A-1", NOW_S + step, step / 2), NOW_S + step, LINE) is None
        batches.append(of.next_batch(NOW_S + 12).to_bytes())
        assert of.robots[robot("A-1")].deviations["size-over-limit"] == 1, "counted by identity report"
    assert batches[0] == batches[1]


def test_notes_of_many_odd_loads_are_few() -> None:
    of = fleet(datums=DATUMS)
    read = of_vda(of, CARRIER, loads=[load((1e4 + number, 1.0, 1.0)) for number in range(200)])
    assert len(read.loads.notes) == MOST_NOTES


def test_of_many_robots_of_a_model_only_the_first_size_that_is_known_explains_all_at_once() -> None:
    sizes, explained = ModelSizes(), list[int]()
    for number in range(MOST_EXPLAINED + 1):
        sizes.note(f"large {number}", "Acme", "A-1", read_body(StatedBody((400.0, 300.0, 1.0)), (), 30.0))
    for length_m in (1.0, 1.1, 1.0):
        explained += [len(sizes.note("small", "Acme", "A-1", read_body(StatedBody((length_m, 0.8, 1.0)), (), 30.0)))]
    assert explained == [MOST_EXPLAINED + 1, 0, 0]
