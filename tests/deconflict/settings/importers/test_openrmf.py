"""Open-RMF buildings: where their levels lie, what is kept, what is said, and what is refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import shapely

from deconflict.settings.importers.drawing import DrawnSite
from deconflict.settings.importers.plan import ImportedPlan, PlanError, UnusedParts
from deconflict.settings.importers.plan_reader import ImportedSite, imported_site
from tests.deconflict.settings.importers.made_buildings import (
    Building,
    as_graph,
    in_metres,
    on_drawings,
    saved,
)

Change = Callable[[Building], Any]


def imported(building: Building, folder: Path, *changes: Change) -> ImportedSite:
    for change in changes:
        change(building)
    return imported_site(saved(building, folder), 1.2)


def outlines_of(site: DrawnSite) -> list[shapely.Polygon]:
    """Every outline of every floor, in order."""
    return [shapely.Polygon(outline) for datum in site.datums for _, _, outline in site.drawn_on(datum.id)]


def left_out(plan: ImportedPlan) -> dict[str, str]:
    return {part.parts: part.reason for part in plan.left_out}


def level(building: Building, name: str = "Ground") -> dict[str, Any]:
    return building["levels"][name]


@pytest.mark.parametrize("seed", range(12))
def test_levels_lie_above_each_other_however_they_are_drawn(seed: int, tmp_path: Path) -> None:
    drawn, plain = imported(on_drawings(seed), tmp_path), imported(in_metres(), tmp_path)
    assert drawn.plan.doubts == ()
    found, wanted = outlines_of(drawn.site), outlines_of(plain.site)
    assert len(found) == len(wanted) == 3 * 7
    assert (
        max(
            drawn_outline.hausdorff_distance(plain_outline)
            for drawn_outline, plain_outline in zip(found, wanted, strict=True)
        )
        < 0.002
    )


def test_levels_without_common_fiducials_keep_their_own_frames_and_say_so(tmp_path: Path) -> None:
    def measured(building: Building) -> None:
        for each in building["levels"].values():
            each["measurements"] = [[0, 1, {"distance": [3, 12.0]}]]
            each["fiducials"] = each["fiducials"][:1]

    both = imported(on_drawings(1), tmp_path, measured)
    (doubt,) = both.plan.doubts
    assert doubt.startswith("Upper and Roof: no two fiducials in common with the reference level Ground;")
    lift = both.plan.lifts[0]
    cabins = {floor.name: node.at for floor in both.plan.levels for node in floor.nodes if node.lift}
    assert {"Upper": lift.at, **dict(lift.landings or ())} == {name: pytest.approx(at) for name, at in cabins.items()}


def test_a_lift_opens_where_it_has_doors_and_a_place(tmp_path: Path) -> None:
    def apart(building: Building) -> None:
        level(building, "Roof")["fiducials"] = []
        level(building, "Roof")["measurements"] = [[0, 1, {"distance": [3, 12.0]}]]
        level(building, "Roof")["vertices"][2][4:] = []
        del building["lifts"]["Lift"]["level_doors"]["Ground"]

    plan = imported(on_drawings(), tmp_path, apart).plan
    assert plan.lifts[0].landings == ()
    assert "Lift has doors on Roof, but no vertex in its cabin; it does not open there" in plan.doubts
    assert left_out(plan)["1 vertex in a lift"] == "the lift has no doors there: Lift on Ground"


def test_lifts_that_can_not_be_drawn_are_named(tmp_path: Path) -> None:
    lost: Change = lambda building: building["lifts"]["Lift"].update(reference_floor_name="Cellar", doors={"d": {}})  # noqa: E731
    unknown: Change = lambda building: level(building)["vertices"][3].append({"lift_cabin": [1, "Hoist"]})  # noqa: E731
    plan = imported(in_metres(), tmp_path, lost, unknown).plan
    assert plan.lifts == ()
    reasons = left_out(plan)
    assert reasons["1 lift"] == "their reference floor is no level of the file: Lift on Cellar"
    assert reasons["1 vertex in a lift"] == "the file has no lift of that name: Hoist"


def test_a_lift_without_a_floor_is_on_the_reference_level(tmp_path: Path) -> None:
    plan = imported(in_metres(), tmp_path, lambda building: building["lifts"]["Lift"].pop("reference_floor_name")).plan
    assert plan.lifts[0].level == "Ground"


def test_only_one_robot_may_be_in_a_mutex_group(tmp_path: Path) -> None:
    def group(building: Building) -> None:
        level(building)["lanes"][1][2]["mutex"] = [1, "narrow"]
        level(building)["vertices"][3].append({"mutex": [1, "narrow"]})
        level(building)["vertices"][4].append({"mutex": [1, ""]})

    site = imported(in_metres(), tmp_path, group).site
    (crossing,) = [zone for zone in site.zones if zone.kind == "crossing"]
    assert (crossing.name, crossing.datum) == ("narrow", site.datums[0].id)
    outline = shapely.Polygon(crossing.polygon)
    assert all(outline.contains(shapely.Point(at)) for at in ((14.0, -3.0), (14.0, -9.0), (20.0, -9.0)))
    assert not outline.contains(shapely.Point(2.0, -3.0))


def test_a_mutex_group_of_lanes_in_a_row_is_no_wider_than_they_are(tmp_path: Path) -> None:
    def group(building: Building) -> None:
        for lane in level(building)["lanes"]:
            lane[2]["mutex"] = [1, "corner"]

    (crossing,) = [zone for zone in imported(in_metres(), tmp_path, group).site.zones if zone.kind == "crossing"]
    outline = shapely.Polygon(crossing.polygon)
    assert all(outline.contains(shapely.Point(at)) for at in ((2.0, -3.0), (14.0, -3.0), (14.0, -9.0)))
    assert not outline.contains(shapely.Point(10.0, -5.0))


def test_lanes_of_several_fleets_are_one(tmp_path: Path) -> None:
    def fleets(building: Building) -> None:
        two_way, one_way = {"bidirectional": [4, True]}, {"bidirectional": [4, False]}
        level(building)["lanes"] = [
            [0, 1, two_way],
            [1, 0, one_way],
            [1, 2, one_way],
            [2, 1, one_way],
            [2, 3, one_way],
            [3, 3, one_way],
        ]

    plan = imported(in_metres(), tmp_path, fleets).plan
    assert [(lane.start, lane.end, lane.two_way) for lane in plan.levels[0].lanes] == [
        ("0", "1", True),
        ("1", "2", True),
        ("2", "3", False),
    ]
    assert left_out(plan)["1 lane"] == "from a vertex to itself"


def test_what_is_left_out_is_counted_by_kind(tmp_path: Path) -> None:
    def furnished(building: Building) -> None:
        for each in building["levels"].values():
            each.update(models=[{}, {}], floors=[{}], layers={"robot": {}}, holes=[], gardens=[1])
        level(building)["vertices"][3] = [20.0, -9.0, 0, "lobby", {"is_holding_point": [4, True], "odd": [1, "x"]}]
        level(building)["lanes"][0][2] |= {"speed_limit": [3, 0.5], "orientation": [1, ""]}
        level(building)["lanes"].append([1, 0, {}])
        level(building)["doors"] = [[3, 4, {"type": [1, "double_hinged"]}], [3, 3, {}]]
        building["zones"] = {"wait": {}}

    found = imported(in_metres(), tmp_path, furnished)
    assert list(left_out(found.plan)) == [
        "3 floor polygons",
        "3 x gardens",
        "3 image layers",
        "6 models",
        "1 holding point",
        "1 x odd of vertices",
        "1 named vertex",
        "1 speed limit",
        "1 lane",
        "1 swing of a door",
        "1 zone",
    ]
    assert UnusedParts("1 door", "without width") in found.site.left_out
    assert sum(zone.kind == "door" for zone in found.site.zones) == 3


def degrees(building: Building, grid: str | None = "EPSG:32632") -> None:
    """The same floors about 500 km east of the meridian of a grid's false easting, at 48 degrees north."""
    building["coordinate_system"] = "wgs84"
    building["parameters"] = {"generate_crs": [1, grid]} if grid else {}
    for each in building["levels"].values():
        each["vertices"] = [[9 + x * 1.3408e-5, 48 + y * 8.994e-6, *rest] for x, y, *rest in each["vertices"]]
    lift = building["lifts"]["Lift"]
    lift["x"], lift["y"] = 9 + lift["x"] * 1.3408e-5, 48 + lift["y"] * 8.994e-6


def test_degrees_become_metres_of_the_grid_that_the_file_names(tmp_path: Path) -> None:
    plan = imported(in_metres(), tmp_path, degrees).plan
    assert plan.format == "an Open-RMF building in metres of EPSG:32632"
    charger, goods, *_ = (node.at for node in plan.levels[0].nodes)
    assert charger == pytest.approx((500002.0, 5316300), abs=100)
    assert goods[0] - charger[0] == pytest.approx(12.0, abs=0.01)
    assert goods[1] - charger[1] == pytest.approx(0.0, abs=0.01)
    assert plan.lifts[0].at[1] - charger[1] == pytest.approx(-6.0, abs=0.01)


def put(value: Any, *keys: Any) -> Change:
    """Replace what is under some keys of the ground floor."""

    def change(building: Building) -> None:
        part: Any = level(building)
        for key in keys[:-1]:
            part = part[key]
        part[keys[-1]] = value

    return change


def on(name: str, **parts: Any) -> Change:
    return lambda building: level(building, name).update(parts)


MEASURED = [[0, 1, {"distance": [3, 12.0]}]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("left", "vertices", 3, 0), r"levels.Ground.vertices.3, x: must be a number .*, not 'left'"),
        (put(float("nan"), "vertices", 3, 1), r"levels.Ground.vertices.3, y: must be a number .*, not nan"),
        (put(True, "vertices", 3, 1), r"levels.Ground.vertices.3, y: must be a number .*, not True"),
        (put("20,-9", "vertices", 3), r"levels.Ground.vertices.3: must be a list, not '20,-9'"),
        (put([1.0], "vertices", 3), r"levels.Ground.vertices.3: must begin with x and y"),
        (put({"a": 1}, "vertices"), r"levels.Ground.vertices: must be a list"),
        (put([3, 4, {"name": "gate"}], "doors", 0), r"levels.Ground.doors.0: name must be \[type, value\], not 'gate'"),
        (put([3, 5, {}], "doors", 0), r"levels.Ground.doors.0: must begin with two vertices from 0 to 4, not \[3, 5"),
        (put([True, 3], "lanes", 0), r"levels.Ground.lanes.0: must begin with two vertices from 0 to 4"),
        (put([-1, 3], "lanes", 0), r"levels.Ground.lanes.0: must begin with two vertices from 0 to 4"),
        (put("high", "elevation"), r"levels.Ground.elevation: must be a number"),
        (
            put([[0, 0, {"distance": [3, 1.0]}]], "measurements"),
            r"levels.Ground.measurements.0: must be a distance above",
        ),
        (put([], "measurements"), r"levels.Ground.measurements: is missing; measure a distance"),
        (on("Roof", fiducials=[]), r"levels.Roof: has neither measurements nor two fiducials in common with the ref"),
        (put([], "fiducials"), r"levels.Upper: has neither measurements nor two fiducials in common"),
        (put("east", "fiducials", 0, 2), r"levels.Ground.fiducials.1: the level has another fiducial 'east'"),
        (put(10**6, "fiducials", 0, 0), r"levels.Upper.fiducials: do not fit those of the reference level Ground"),
        (
            on("Roof", fiducials=[[5, 5, "east"], [5, 5, "north"]]),
            r"levels.Roof.fiducials: 'east' and 'north' are at the same place; move or delete one",
        ),
        (
            on("Roof", measurements=[[0, 1, {"distance": [3, 15.0]}]]),
            r"levels.Roof: its measurements and fiducials contradict each other by 25%; correct or delete",
        ),
        (
            put([*MEASURED, [3, 4, {"distance": [3, 3.0]}]], "measurements"),
            r"levels.Ground.measurements: \d and the mean contradict each other by 20%",
        ),
        (
            on("Roof", fiducials=[[0, 0, "north"], [1, 1, "east"]]),
            r"levels.Roof.vertices.2: is in the cabin of Lift, but .* m from it; correct the vertex, the lift, or",
        ),
        (lambda building: building.update(levels={}), r"levels: have no vertices; draw lanes"),
        (lambda building: building.update(lifts=[1]), r"lifts: must be a table"),
        (lambda building: building["lifts"]["Lift"].pop("yaw"), r"lifts.Lift.yaw: must be a number .*, not None"),
        (lambda building: building["lifts"]["Lift"].update(width=0), r"lifts.Lift: width and depth must be above 0"),
        (lambda building: building.update(reference_level_name="Attic"), r"reference_level_name: must be a level of"),
        (lambda building: building.update(coordinate_system="web_mercator"), r"coordinate_system: must be reference_i"),
    ],
)
def test_wrong_geometry_is_refused_with_what_to_change(change: Change, message: str, tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=message):
        imported(on_drawings(), tmp_path, change)


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (None, "parameters.generate_crs: is missing; name the grid of your robots, in metres, such as EPSG:32632"),
        ("EPSG:0", "parameters.generate_crs: 'EPSG:0' is no known grid"),
        ("EPSG:4326", "parameters.generate_crs: EPSG:4326 is not in metres"),
        ("EPSG:3857", "parameters.generate_crs: EPSG:3857 is wrong by 49% in distances there"),
    ],
)
def test_a_grid_that_gives_no_true_metres_is_refused(grid: str | None, message: str, tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=message):
        imported(in_metres(), tmp_path, lambda building: degrees(building, grid))


def test_metres_that_measurements_contradict_are_refused(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=r"levels.Ground: its measurements and its metres contradict each other by 95%"):
        imported(in_metres(), tmp_path, put([[0, 1, {"distance": [3, 0.6]}]], "measurements"))


def test_places_in_degrees_are_on_the_globe(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=r"levels.Ground.vertices.0: must be longitude and latitude in degrees"):
        imported(in_metres(), tmp_path, degrees, put(200.0, "vertices", 0, 0))


@pytest.mark.parametrize(("metres", "is_said"), [(12.1, False), (12.5, True)])
def test_measurements_that_differ_a_little_are_said(metres: float, is_said: bool, tmp_path: Path) -> None:
    twice = put([*MEASURED, [0, 1, {"distance": [3, metres]}]], "measurements")
    doubts = imported(on_drawings(), tmp_path, twice).plan.doubts
    assert [doubt.partition(";")[0] for doubt in doubts] == (
        ["levels.Ground.measurements: 0 and the mean differ by 2.0%"] if is_said else []
    )


def test_a_navigation_graph_gives_the_places_of_its_building(tmp_path: Path) -> None:
    from_graph, from_building = imported(as_graph(in_metres()), tmp_path), imported(in_metres(), tmp_path)
    assert from_graph.plan.format == "an Open-RMF navigation graph"
    assert [datum.name for datum in from_graph.site.datums] == ["Ground", "Roof", "Upper"]
    assert len(from_graph.plan.doubts) == 2
    for name in ("Ground", "Roof", "Upper"):
        found, wanted = (
            {(kind, tuple(sorted(outline))) for datum in datums for kind, _, outline in site.drawn_on(datum.id)}
            for site in (from_graph.site, from_building.site)
            if (datums := [datum for datum in site.datums if datum.name == name])
        )
        assert found == {(kind, outline) for kind, outline in wanted if kind != "wall"}


def test_a_graph_of_the_site_editor_has_docks_on_lanes_and_perhaps_no_lifts(tmp_path: Path) -> None:
    graph = as_graph(in_metres())
    level(graph)["vertices"][4][2]["name"] = "bay"
    level(graph)["lanes"].append([3, 4, {"dock_name": "bay dock"}])
    graph["lifts"]["Hoist"] = graph["lifts"]["Lift"]
    plan = imported(graph, tmp_path).plan
    assert [node.name for node in plan.levels[0].nodes if node.use == "dock"] == ["goods", "bay"]
    assert [lift.name for lift in plan.lifts] == ["Lift"]
    assert left_out(plan)["1 lift"] == "no vertex of the graph is in it"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put([1.0, 2.0], "vertices", 1), r"levels.Ground.vertices.1: must be x, y and properties"),
        (put([0, 1, "fast"], "lanes", 1), r"levels.Ground.lanes.1: must be a table, not 'fast'"),
        (put([0], "lanes", 1), r"levels.Ground.lanes.1: must begin with two vertices from 0 to 6"),
        (lambda graph: graph["doors"].update(hatch=1), r"doors.hatch: must be a table, not 1"),
        (lambda graph: graph["lifts"]["Lift"].pop("dims"), r"lifts.Lift: must have x, y and yaw as position"),
    ],
)
def test_faults_of_a_navigation_graph_are_named(change: Change, message: str, tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=message):
        imported(as_graph(in_metres()), tmp_path, change)
