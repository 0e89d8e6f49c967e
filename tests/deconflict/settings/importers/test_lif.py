"""Layouts in the Layout Interchange Format."""

import copy
import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import shapely

from deconflict.settings.importers.plan import PlanError
from deconflict.settings.importers.plan_reader import ImportedSite, imported_site
from deconflict.settings.shared_places import Resource, Zone
from tests.deconflict.settings.importers.made_plans import LIF, lif_curve, lif_edge, lif_file, lif_layout, lif_node

LATE = {"degree": 1, "controlPoints": [{"x": 1, "y": 0}, {"x": 20, "y": 0}]}
SHORT = {"degree": 1, "controlPoints": [{"x": 20, "y": 0}, {"x": 1, "y": 0}]}


def imported(folder: Path, document: dict[str, Any]) -> ImportedSite:
    path = folder / "works.lif"
    path.write_text(json.dumps(document), encoding="utf-8")
    return imported_site(path, 1.2)


def left_out(found: ImportedSite) -> dict[str, str]:
    return {left.parts: left.reason for left in found.site.left_out}


def middle(place: Resource | Zone) -> tuple[float, float]:
    x, y = shapely.Polygon(place.polygon).centroid.coords[0]
    return round(x, 3), round(y, 3)


def test_maps_are_floors_and_their_ids_are_those_that_robots_send(tmp_path: Path) -> None:
    found = imported(tmp_path, LIF)
    floors = [(datum.id, datum.name, datum.level) for datum in found.site.datums]
    assert floors == [("hall", "1", 0), ("upper", "2", 1)]
    by_floor = Counter(place.datum for place in (*found.site.resources, *found.site.zones))
    assert by_floor == {"hall": 9, "upper": 2}
    assert left_out(found)["1 way between two floors"].startswith("C to U1: a lift or a ramp")


def test_stations_are_where_robots_stand_and_their_actions_say_what_for(tmp_path: Path) -> None:
    found = imported(tmp_path, LIF)
    assert [(place.kind, place.name, middle(place)) for place in found.site.resources] == [
        ("charger", "Charger 1", (0.0, 0.0)),
        ("dock", "Press", (20.0, -12.0)),
        ("station", "Wrapper", (42.0, 10.0)),
        ("station", "s5", (36.0, 14.0)),
        ("parking", "U2", (45.0, 10.0)),
    ]
    assert left_out(found).keys() >= {"1 station", "1 name of a station", "2 heights of stations"}


def test_edges_back_and_forth_along_one_line_are_one_lane(tmp_path: Path) -> None:
    found = imported(tmp_path, LIF)
    lanes = [(lane.start, lane.end, lane.two_way) for level in found.plan.levels for lane in level.lanes]
    assert lanes == [
        ("A", "B", True),
        ("B", "D", False),
        ("B", "C", True),
        ("C", "E", False),
        ("U1", "U2", True),
    ]
    aside = lif_edge("C", "B", trajectory=lif_curve((30, 10), (20, 10), (20, 5), (20, 0)))
    document = copy.deepcopy(LIF)
    document["layouts"][2]["edges"][0] = aside
    lanes = [(lane.start, lane.end, lane.two_way) for lane in imported(tmp_path, document).plan.levels[0].lanes]
    assert lanes.count(("B", "C", False)) == lanes.count(("C", "B", False)) == 1


def test_a_bent_aisle_lies_along_its_curve_in_parts_that_are_nearly_straight(tmp_path: Path) -> None:
    parts = [zone for zone in imported(tmp_path, LIF).site.zones if "lane-b-c" in zone.id]
    axes = [part.axis for part in parts if part.axis]
    assert (axes[0][0], axes[-1][1]) == ((20.0, 0.0), (30.0, 10.0))
    assert [end for _, end in axes[:-1]] == [start for start, _ in axes[1:]]
    for part, axis in zip(parts, axes, strict=True):
        assert shapely.LineString(axis).length > 2.4
        assert shapely.Polygon(part.polygon).hausdorff_distance(shapely.LineString(axis)) < 1.3
    assert shapely.union_all([shapely.Polygon(part.polygon) for part in parts]).contains(shapely.Point(27.0, 2.6))


def test_what_edges_say_beside_their_line_is_named(tmp_path: Path) -> None:
    found = left_out(imported(tmp_path, LIF))
    assert found["10 edges with limits or actions"].startswith("maxSpeed, rotationAllowed: ")
    assert "1 edge" in found
    types = lif_edge("A", "B")
    types["vehicleTypeEdgeProperties"].append({"vehicleTypeId": "truck", "trajectory": LATE})
    document = lif_file(lif_layout("hall", "1", [lif_node("A", 0, 0), lif_node("B", 20, 0)], [types]))
    document["layouts"][0]["edges"].append(lif_edge("B", "A", trajectory=SHORT))
    found = left_out(imported(tmp_path, document))
    assert {"2 curves of edges", "which of 2 types of robots use a lane"} <= found.keys()


def test_version_2_is_read_like_version_1(tmp_path: Path) -> None:
    text = json.dumps(LIF).replace("vehicleType", "mobileRobotType").replace('"actions"', '"feasibleActions"')
    newer = json.loads(text)
    newer["metaInformation"] = {"lifId": "works", "lifVersion": "2.0.0"}
    newer["origins"] = [{"originId": "o", "layouts": newer.pop("layouts")}]
    assert imported(tmp_path, newer).site.resources == imported(tmp_path, LIF).site.resources


def over_each_other() -> dict[str, Any]:
    upper = [lif_node("U1", 0, 0), lif_node("U2", 20, 0)]
    return lif_file(
        lif_layout("ground", "1", [lif_node("A", 5, -5), lif_node("B", 5, 5)], []), lif_layout("up", "2", upper, [])
    )


def test_two_levels_beside_each_other_in_one_map_are_one_floor(tmp_path: Path) -> None:
    document = over_each_other()
    for node in document["layouts"][1]["nodes"]:
        node["nodePosition"]["x"] += 6
    assert [datum.id for datum in imported(tmp_path, document).site.datums] == ["hall"]


def test_nodes_of_one_layout_with_several_maps_are_on_several_floors(tmp_path: Path) -> None:
    nodes = [lif_node("A", 0, 0, "west", "pick"), lif_node("B", 20, 0, "east", "drop")]
    found = imported(tmp_path, lif_file(lif_layout("hall", "1", nodes, [])))
    assert [(datum.id, datum.name) for datum in found.site.datums] == [("west", "1 west"), ("east", "1 east")]


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (lif_file(version="3.0.0"), "'3.0.0' is not known"),
        (lif_file(), "has no nodes"),
        (over_each_other(), "levels '1' and '2' lie over each other in one map"),
        (
            lif_file(
                lif_layout("hall", "1", [lif_node("A", 0, 0), lif_node("B", 20000, 0)], [lif_edge("A", "B")]),
            ),
            "look like millimetres",
        ),
        (lif_file(lif_layout("hall", "1", [lif_node("A", 0, 0), lif_node("A", 9, 0)], [])), "'A' is given twice"),
        (lif_file(lif_layout("hall", "1", [lif_node("A", float("nan"), 0)], [])), "is not finite"),
        (lif_file(lif_layout("hall", "1", [{"nodeId": "A", "mapId": "hall"}], [])), "'A' has no nodePosition"),
        (
            lif_file(
                lif_layout("h", "1", [lif_node("A", 0, 0, ""), lif_node("B", 0, 0, "w"), lif_node("C", 0, 0, "e")], [])
            ),
            "'A' has no mapId, and its layout has several",
        ),
    ],
)
def test_a_layout_whose_places_would_be_wrong_is_refused(
    document: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(PlanError, match=message):
        imported(tmp_path, document)
