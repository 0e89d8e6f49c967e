import pytest

from deconflict.advisories.words.place_names import PlaceNames
from deconflict.settings.shared_places import NamedArea, Obstacle, Resource, Zone
from ingest.batch import FloorPoint
from ingest.settings import Datum, ReferencePoint

HALL = Datum(
    id="hall",
    name="Ground hall",
    reference_points=(ReferencePoint(id="p1", name="Column A1", x=0.0, y=0.0), ReferencePoint(id="p2", x=30.0, y=0.0)),
)
ABROAD = Datum(
    id="abroad",
    name="Yard",
    coordinates="latlon",
    reference_location=(48.0, 11.0),
    reference_points=(ReferencePoint(id="p3", name="Gate", x=48.0, y=11.0),),
)
AISLE = Zone(
    id="a4",
    name="Aisle 4",
    kind="aisle",
    datum="hall",
    polygon=((20, 0), (40, 0), (40, 6), (20, 6)),
    axis=((20, 3), (40, 3)),
)
DOCK = Resource(id="d1", name="Dock 1", kind="dock", datum="hall", polygon=((30, 2), (34, 2), (34, 4), (30, 4)))
NORTH = NamedArea(name="North aisle", floor="hall", outline_m=((18, 20), (60, 20), (60, 24), (18, 24)))
CROSS = NamedArea(name="Aisle 7", floor="hall", outline_m=((50, 0), (54, 0), (54, 30), (50, 30)))
PLACE_NAMES = PlaceNames((HALL, ABROAD), (DOCK, AISLE), (), (NORTH, CROSS))


DESCRIBED = [
    (FloorPoint("hall", 22.0, 1.0), "in Aisle 4 on Ground hall"),
    (FloorPoint("hall", 31.0, 3.0), "at Dock 1 on Ground hall"),
    (FloorPoint("hall", 3.0, 4.0), "5 m from Column A1 on Ground hall"),
    (FloorPoint("hall", 0.5, 0.5), "at Column A1 on Ground hall"),
    (FloorPoint("hall", 22.0, 21.0), "in North aisle on Ground hall"),
    (FloorPoint("hall", 51.0, 21.0), "where North aisle meets Aisle 7 on Ground hall"),
    (FloorPoint("hall", 30.0, 9.0), "3 m from Aisle 4 on Ground hall"),
    (FloorPoint("abroad", 48.0, 11.0), "near (48.0, 11.0) on Yard"),
    (FloorPoint("hall", 0.0, -40.0), "near (0.0, -40.0) on Ground hall"),
    (FloorPoint("nowhere", 1.0, 2.0), "near (1.0, 2.0) on nowhere"),
]


def texts(names: PlaceNames, points: list[FloorPoint]) -> list[str]:
    return [spot.text for spot in names.describe(points)]


@pytest.mark.parametrize(("point", "phrase"), DESCRIBED)
def test_a_point_is_described_by_the_place_around_it_or_the_nearest_mark(point: FloorPoint, phrase: str) -> None:
    assert texts(PLACE_NAMES, [point]) == [phrase]


def test_a_place_with_the_name_of_its_floor_names_it_once() -> None:
    whole = AISLE.model_copy(update={"name": "Ground hall"})
    assert texts(PlaceNames((HALL,), (whole,)), [FloorPoint("hall", 22.0, 1.0)]) == ["in Ground hall"]


def test_a_mark_behind_a_wall_names_no_place() -> None:
    wall = Obstacle(kind="wall", outline_m=((1, 1), (9, 1), (9, 1.2), (1, 1.2)))
    rack = Obstacle(kind="rack", name="Rack B", floor="hall", outline_m=((2, 8), (9, 8), (9, 9), (2, 9)))
    names = PlaceNames((HALL,), (), (wall, rack))
    assert texts(names, [FloorPoint("hall", 4.0, 3.0)]) == ["5 m from Rack B on Ground hall"], "the column is hidden"
    assert texts(names, [FloorPoint("hall", 0.5, 3.0)]) == ["3 m from Column A1 on Ground hall"]
    assert texts(names, [FloorPoint("hall", 4.0, 10.0)]) == ["at Rack B on Ground hall"], "an obstacle hides not itself"


def test_many_points_are_described_as_each_is_alone() -> None:
    assert texts(PLACE_NAMES, [point for point, _ in DESCRIBED * 2]) == [phrase for _, phrase in DESCRIBED * 2]
    assert texts(PLACE_NAMES, []) == []


@pytest.mark.parametrize(
    ("row", "places"),
    [
        (0, [("a4", "Aisle 4")]),
        (1, [("d1", "Dock 1")]),
        (2, []),
        (5, [(None, "North aisle"), (None, "Aisle 7")]),
        (6, [("a4", "Aisle 4")]),
    ],
)
def test_the_places_that_the_words_name_come_as_facts(row: int, places: list[tuple[str | None, str]]) -> None:
    (spot,) = PLACE_NAMES.describe([DESCRIBED[row][0]])
    assert [(place.id, place.name) for place in spot.places] == places
