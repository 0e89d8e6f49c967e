"""Plant models of openTCS: their floors, the paths that are used, and curves."""

from math import dist
from pathlib import Path

import pytest
import shapely

from deconflict.settings.importers.plan import PlanError
from deconflict.settings.importers.plan_reader import ImportedSite, imported_site

LAYERS = """
<visualLayout name="V" scaleX="50.0" scaleY="50.0">
  <layer id="0" ordinal="0" name="paths" groupId="0"/><layer id="1" ordinal="1" name="docks" groupId="0"/>
  <layer id="2" ordinal="2" name="upstairs" groupId="1"/>
  <layerGroup id="0" name="Ground"/><layerGroup id="1" name="First"/>
</visualLayout>
"""


def point(
    name: str, x_m: float, y_m: float, *, layer: int = 0, z_m: float = 0, map_id: str = "", drawn: str = ""
) -> str:
    at = f'positionX="{x_m * 1000:.0f}" positionY="{y_m * 1000:.0f}" positionZ="{z_m * 1000:.0f}"'
    of_map = f'<property name="vda5050:mapId" value="{map_id}"/>' if map_id else ""
    layout = f'<pointLayout labelOffsetX="0" labelOffsetY="0" layerId="{layer}" {drawn}/>'
    return f'<point name="{name}" {at} type="HALT_POSITION">{of_map}{layout}</point>'


def path(start: str, end: str, layout: str = "", **keys: str) -> str:
    given = {"maxVelocity": "1000", "maxReverseVelocity": "0", "locked": "false", **keys}
    attributes = " ".join(f'{key}="{value}"' for key, value in given.items())
    ends = f'sourcePoint="{start}" destinationPoint="{end}" length="1"'
    return f'<path name="{start} --- {end}" {ends} {attributes}>{layout}</path>'


def curve(kind: str, *corners: tuple[int, int]) -> str:
    """Corners in steps of the drawing's grid, with y downwards."""
    points = "".join(f'<controlPoint x="{x}" y="{y}"/>' for x, y in corners)
    return f'<pathLayout connectionType="{kind}" layerId="0">{points}</pathLayout>'


def imported(folder: Path, *parts: str, layers: str = LAYERS) -> ImportedSite:
    file = folder / "hall.xml"
    file.write_text(f'<model version="7.0.0" name="hall">{"".join(parts)}{layers}</model>')
    return imported_site(file, 1.2)


def floors(found: ImportedSite) -> list[tuple[str, list[str]]]:
    return [(level.name, [node.id for node in level.nodes]) for level in found.plan.levels]


def datums(found: ImportedSite) -> list[str]:
    return [level.datum for level in found.plan.levels]


def left_out(found: ImportedSite) -> dict[str, str]:
    return {left.parts: left.reason for left in found.plan.left_out}


def ways(found: ImportedSite) -> list[tuple[str, str, bool]]:
    return [(lane.start, lane.end, lane.two_way) for level in found.plan.levels for lane in level.lanes]


def test_a_map_of_vda_5050_is_a_floor_with_the_id_that_robots_send(tmp_path: Path) -> None:
    points = [
        point("U1", 0, 0, layer=2, map_id="Upper", z_m=6),
        point("G1", 0, 0, map_id="ground"),
        point("G2", 9, 0, layer=1, map_id="Ground"),
        point("G3", 9, 9, layer=1),
    ]
    found = imported(tmp_path, *points, path("G1", "U1"), path("U1", "G1"), path("G1", "G2"))
    assert floors(found) == [("Ground", ["G1", "G2", "G3"]), ("First", ["U1"])]
    assert datums(found) == ["ground", "Upper"]
    assert "1 way between two floors" in left_out(found)
    assert ways(found) == [("G1", "G2", False)]


def test_a_point_without_a_map_is_in_that_of_the_vehicles(tmp_path: Path) -> None:
    vehicle = '<vehicle name="V1"><property name="vda5050:mapId" value="hall"/></vehicle>'
    points = [point("A", 0, 0), point("B", 9, 0, map_id="annex")]
    found = imported(tmp_path, *points, vehicle)
    assert floors(found) == [("hall", ["A"]), ("annex", ["B"])]
    with pytest.raises(PlanError, match="'C' has no property vda5050:mapId, and the points of its layer have several"):
        imported(tmp_path, point("A", 0, 0, map_id="hall"), point("B", 9, 0, map_id="annex"), point("C", 5, 0))


def test_groups_of_layers_are_floors_and_layers_of_one_group_are_not(tmp_path: Path) -> None:
    found = imported(tmp_path, point("A", 0, 0), point("B", 9, 0, layer=1), point("C", 0, 0, layer=2))
    assert floors(found) == [("Ground", ["A", "B"]), ("First", ["C"])]
    assert datums(found) == ["", ""]
    assert found.plan.doubts[0].startswith("groups of layers tell the floors, ")
    twice = LAYERS.replace("First", "Ground")
    found = imported(tmp_path, point("A", 0, 0), point("C", 0, 0, layer=2), layers=twice)
    assert floors(found) == [("Ground 0", ["A"]), ("Ground 1", ["C"])]
    found = imported(tmp_path, point("A", 0, 0), point("B", 9, 0, layer=1))
    assert floors(found) == [("0", ["A", "B"])]
    assert found.plan.doubts[0].startswith("2 layers are one floor, ")


def test_heights_tell_floors_if_nothing_else_does(tmp_path: Path) -> None:
    heights = {"A": 4.5, "B": 0.0, "C": 0.6, "D": 1.2}
    found = imported(tmp_path, *(point(name, row, 0, z_m=z_m) for row, (name, z_m) in enumerate(heights.items())))
    assert floors(found) == [("0", ["B", "C", "D"]), ("1", ["A"])]
    assert found.plan.doubts[0].startswith("heights tell the floors, ")


def test_paths_that_no_vehicle_may_drive_are_counted(tmp_path: Path) -> None:
    points = [point(name, 9 * row, 0) for row, name in enumerate("ABCDE")]
    paths = [
        path("A", "B"),
        path("B", "A", locked="true"),
        path("B", "C", maxVelocity="0"),
        path("C", "D", maxVelocity="0", maxReverseVelocity="500"),
        path("E", "D", maxReverseVelocity="500"),
        path("E", "gone"),
    ]
    found = imported(tmp_path, *points, *paths)
    assert ways(found) == [("A", "B", False), ("D", "C", False), ("D", "E", True)]
    assert left_out(found).keys() >= {"1 locked path", "1 path without a speed", "1 path"}


def test_a_curve_is_followed_where_its_drawing_fits(tmp_path: Path) -> None:
    ends = point("A", 0, 0), point("B", 10, 10)
    bezier = path("A", "B", curve("BEZIER", (200, 0), (200, 0)), maxReverseVelocity="500")
    (level,) = imported(tmp_path, *ends, bezier).plan.levels
    bends = level.lanes[0].bends
    assert min(dist(bend, (8.75, 1.25)) for bend in bends) < 0.2
    far_off = "positionX='40000' positionY='0'"
    aside = imported(tmp_path, ends[0], point("B", 10, 10, drawn=far_off), bezier)
    assert aside.plan.levels[0].lanes[0].bends == ()
    assert "1 curve of a path" in left_out(aside)
    old = '<visualLayout><modelLayoutElement><property name="CONTROL_POINTS" value="2,0;2,0"/></modelLayoutElement>'
    assert "1 curve of a path" in left_out(imported(tmp_path, *ends, path("A", "B"), layers=f"{old}</visualLayout>"))
    far = path("A", "B", curve("BEZIER", (2000, 0), (2000, 0)))
    assert "1 curve of a path" in left_out(imported(tmp_path, *ends, far))


def test_two_curves_in_a_row_corners_and_unknown_corners(tmp_path: Path) -> None:
    ends = point("A", 0, 0), point("B", 10, 0)
    double = path("A", "B", curve("BEZIER_3", (50, -60), (80, -60), (100, 0), (120, 60), (150, 60)))
    (lane,) = imported(tmp_path, *ends, double).plan.levels[0].lanes
    assert shapely.LineString(lane.bends).distance(shapely.Point(5, 0)) < 0.05
    assert max(y for _, y in lane.bends) > 1.5 < -min(y for _, y in lane.bends) + 3.0
    (lane,) = imported(tmp_path, *ends, path("A", "B", curve("POLYPATH", (100, -60)))).plan.levels[0].lanes
    assert lane.bends == ((5.0, 3.0),)
    found = imported(tmp_path, *ends, path("A", "B", curve("ELBOW")))
    assert "1 path with corners" in left_out(found)


def test_the_operations_of_a_link_then_the_symbol_say_what_a_location_is_for(tmp_path: Path) -> None:
    kinds = (
        '<locationType name="Cell"><allowedOperation name="Load"/><allowedOperation name="Charge"/></locationType>'
        '<locationType name="T7"><locationTypeLayout locationRepresentation="RECHARGE_GENERIC"/></locationType>'
        '<locationType name="Waiting for parking"/>'
        '<location name="L1" type="Cell"><link point="A"><allowedOperation name="Load"/></link></location>'
        '<location name="L2" type="T7"><link point="B"/></location>'
        '<location name="L3" type="Waiting for parking"><link point="C"/></location>'
        '<location name="L4" type="T7"/><location name="L5" type="Cell"><link point="A"/></location>'
    )
    found = imported(tmp_path, point("A", 0, 0), point("B", 9, 0), point("C", 18, 0), kinds)
    uses = [(place.name, place.kind) for place in found.site.resources]
    assert uses == [("L1", "dock"), ("L2", "charger"), ("L3", "parking")]
    assert left_out(found).keys() >= {"1 location", "1 link of a location"}


def test_points_that_were_only_drawn_are_refused(tmp_path: Path) -> None:
    drawn = "positionX='20000' positionY='0'"
    with pytest.raises(PlanError, match=r"2 of 2 points are at x 0 and y 0, .*Copy layout values to model"):
        imported(tmp_path, point("A", 0, 0), point("B", 0, 0, drawn=drawn))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<tcsOrderSet/>", "is a set of transport orders of openTCS; import the plant model"),
        ('<svg xmlns="http://www.w3.org/2000/svg"/>', r"is a drawing \(SVG\)"),
        ("<note/>", "is XML, but no openTCS plant model, .*; found <note>"),
        ('<model version="6.0.0" name="empty"/>', "the model has no points"),
    ],
)
def test_other_xml_is_named(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "hall.xml"
    file.write_text(text)
    with pytest.raises(PlanError, match=message):
        imported_site(file, 1.2)


def test_the_outline_of_a_block_holds_its_curves(tmp_path: Path) -> None:
    lane = path("B", "A", curve("POLYPATH", (100, -200)), maxReverseVelocity="500")
    block = '<block name="K" type="SINGLE_VEHICLE_ONLY"><member name="B --- A"/></block>'
    shared = '<block name="S" type="SAME_DIRECTION_ONLY"><member name="B --- A"/></block>'
    found = imported(tmp_path, point("A", 0, 0), point("B", 10, 0), lane, block, shared)
    crossing = found.site.zones[0]
    assert shapely.Polygon(crossing.polygon).contains(shapely.Point(5, 10))
    assert "1 block for one direction at a time" in left_out(found)
