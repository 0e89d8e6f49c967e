from typing import Any

import pytest

from ingest.languages.model import Identity
from ingest.shapes import Shape
from tests.helpers.vda_saying import FACTSHEET, MAKER, SERIAL, factsheet
from tests.ingest.languages.vda5050.made_vda import Listener, T


def identity(**keys: Any) -> Identity:
    read = Listener().hears("factsheet", factsheet(T, **keys))
    assert isinstance(read, Identity)
    return read


def outline(x: float, y: float, away_m: float = 0.0) -> list[dict[str, float]]:
    """A rectangle of 2 x by 2 y whose centre is `away_m` ahead."""
    return [{"x": away_m + a, "y": b} for a, b in ((x, y), (-x, y), (-x, -y), (x, -y))]


def test_a_factsheet_identifies_a_robot() -> None:
    read = identity()
    assert (read.manufacturer, read.serial, read.model) == (MAKER, SERIAL, "Carrier")
    assert (read.envelope_m, read.offset_m, read.max_speed_mps) == ((1.2, 0.8, 1.5), (0.0, 0.0), 1.0)


def test_version_3_has_other_names_for_the_same() -> None:
    read = identity(
        typeSpecification={"seriesName": "Carrier", "mobileRobotKinematics": "OMNI"},
        physicalParameters={"length": 1.2, "width": 0.8, "maximumHeight": 1.5, "maximumSpeed": 2.0},
        mobileRobotGeometry={"envelopes2d": [{"envelope2dId": "body", "vertices": outline(0.6, 0.4)}]},
    )
    assert (read.envelope_m, read.max_speed_mps) == ((1.2, 0.8, 1.5), 2.0)


def test_the_outline_nearest_to_the_stated_size_is_the_body() -> None:
    """Others are for protective fields, or for loads."""
    outlines = [
        {"set": "field", "polygonPoints": outline(2.0, 1.0)},
        {"set": "body", "polygonPoints": outline(0.65, 0.4, away_m=0.2)},
        {"set": "drive", "polygonPoints": outline(0.2, 0.2)},
    ]
    read = identity(agvGeometry={"envelopes2d": outlines})
    assert read.envelope_m == pytest.approx((1.3, 0.8, 1.5))
    assert read.offset_m == pytest.approx((0.2, 0.0))


def test_a_robot_of_which_only_the_outline_is_known_has_its_size() -> None:
    geometry = {"envelopes2d": [{"set": "body", "polygonPoints": outline(0.5, 0.3)}]}
    read = identity(physicalParameters={"speedMax": 1.0}, agvGeometry=geometry)
    assert read.envelope_m == pytest.approx((1.0, 0.6, 0.0))


def test_a_name_of_any_length_is_cut() -> None:
    kind = dict(FACTSHEET["typeSpecification"]) | {"seriesName": "x" * 10_000}
    assert len(identity(typeSpecification=kind).model) == 100


def test_an_outline_that_is_no_rectangle_is_the_robots_shape() -> None:
    corners = [(0.6, 0.0), (0.4, 0.4), (-0.6, 0.4), (-0.6, -0.4), (0.4, -0.4)]
    geometry = {"envelopes2d": [{"set": "a", "polygonPoints": [{"x": x, "y": y} for x, y in (*corners, corners[0])]}]}
    read = identity(agvGeometry=geometry)
    assert read.outline == Shape.polygon(corners)
    assert read.envelope_m == pytest.approx((1.2, 0.8, 1.5))
    assert identity(agvGeometry={"envelopes2d": [{"set": "a", "polygonPoints": outline(0.6, 0.4)}]}).outline is None


def test_of_an_outline_that_crosses_itself_only_the_rectangle_counts() -> None:
    crossed = [{"x": x, "y": y} for x, y in ((-1.0, -1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 0.5))]
    read = identity(agvGeometry={"envelopes2d": [{"set": "a", "polygonPoints": crossed}]})
    assert read.outline is None
    assert read.envelope_m == pytest.approx((2.0, 2.0, 1.5))
