"""From a file to a site file that is accepted."""

import os
import struct
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
import shapely

from deconflict.settings.importers.plan import PlanError
from deconflict.settings.importers.plan_reader import imported_site
from deconflict.settings.importers.plan_summary import summary_lines
from deconflict.settings.site import Site
from deconflict.settings.site_file import fit_problems, load
from tests.deconflict.settings.importers.made_plans import BUILDING, PLANT
from tests.helpers.commands import run

RECORDINGS = os.environ.get("DECONFLICT_RECORDINGS")


def site_of(path: Path, width_m: float = 1.2) -> Site:
    """The imported site, loaded as any other."""
    made = path.with_suffix(".toml")
    made.write_text(imported_site(path, width_m).text, encoding="utf-8")
    site = load(made)
    assert fit_problems(site) == []
    return site


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, errors="surrogateescape")
    return path


def kinds(site: Site) -> dict[str, int]:
    return dict(Counter([*(resource.kind for resource in site.resources), *(zone.kind for zone in site.zones)]))


def middle(polygon: tuple[tuple[float, float], ...]) -> tuple[float, float]:
    x, y = shapely.Polygon(polygon).centroid.coords[0]
    return round(x, 3), round(y, 3)


def test_a_building_becomes_a_site_in_metres_with_y_up(tmp_path: Path) -> None:
    site = site_of(written(tmp_path, "works.building.yaml", BUILDING))
    assert (site.name, [(datum.name, datum.level) for datum in site.datums]) == ("works", [("Ground", 0), ("Upper", 1)])
    assert kinds(site) == {"charger": 1, "dock": 1, "parking": 1, "lift": 1, "door": 1, "aisle": 1}
    charger, dock, parking, lift = site.resources
    assert (charger.name, charger.id, middle(charger.polygon)) == ("tug_charger", "ground-tug-charger", (5.0, -10.0))
    assert (dock.kind, middle(dock.polygon)) == ("dock", (15.0, -20.0))
    assert (parking.kind, middle(parking.polygon)) == ("parking", (15.0, -9.0))
    assert (middle(lift.polygon), shapely.Polygon(lift.polygon).area) == ((25.0, -5.0), pytest.approx(6.0))
    assert [(floor.datum, middle(floor.polygon)) for floor in lift.floors] == [(site.datums[1].id, (0.0, 0.0))]
    (wall,) = site.obstacles
    assert (wall.kind, wall.floor) == ("wall", site.datums[0].id)
    assert shapely.Polygon(wall.outline_m).area == pytest.approx(1.0)
    door, aisle = site.zones
    assert (middle(door.polygon), shapely.Polygon(door.polygon).area) == ((20.0, -6.0), pytest.approx(2.0))
    assert aisle.axis == ((5.0, -10.0), (15.0, -10.0))
    assert shapely.Polygon(aisle.polygon).area == pytest.approx(12.0)


@pytest.mark.parametrize(("x", "y"), [("positionX", "positionY"), ("xPosition", "yPosition")])
def test_a_plant_model_of_either_form_becomes_a_site_in_metres(x: str, y: str, tmp_path: Path) -> None:
    site = site_of(written(tmp_path, "hall.xml", PLANT.format(x=x, y=y)))
    assert [(resource.kind, resource.name, middle(resource.polygon)) for resource in site.resources] == [
        ("charger", "Pole 1", (0.0, 0.0)),
        ("parking", "P3", (8.0, 6.0)),
        ("dock", "Goods in", (0.0, 6.0)),
    ]
    crossing, *aisles = site.zones
    assert crossing.name == "B1"
    outline = shapely.Polygon(crossing.polygon)
    assert all(outline.contains(shapely.Point(each)) for each in ((8.0, 0.0), (8.0, 6.0), (0.0, 6.0)))
    assert not outline.contains(shapely.Point(0.0, 0.0))
    assert [aisle.axis for aisle in aisles] == [((0.0, 0.0), (8.0, 0.0)), ((8.0, 0.0), (8.0, 6.0))]


def test_the_same_file_gives_the_same_text_and_ids(tmp_path: Path) -> None:
    path = written(tmp_path, "works.building.yaml", BUILDING)
    assert imported_site(path, 1.2).text == imported_site(path, 1.2).text


def test_equal_names_get_different_ids(tmp_path: Path) -> None:
    text = BUILDING.replace("pantry", "bay").replace("tug_charger", "Bay!")
    site = site_of(written(tmp_path, "works.building.yaml", text))
    assert [resource.id for resource in site.resources] == ["ground-bay", "ground-bay-2", "ground-bay-3", "lift-a"]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.yaml", "name: works\n", "has no levels"),
        ("a.yaml", "- a list\n", "has no levels"),
        ("a.yaml", "levels: {}\nname: a\nlevels: {}\n", "line 1: has the key 'levels' twice; delete one"),
        ("a.json", '{"levels": {}, "levels": {}}', "has the key 'levels' twice in one object; delete one"),
        ("a.svg", '<svg xmlns="http://www.w3.org/2000/svg"/>', "is a drawing"),
        ("a.toml", 'name = "site"\n', "is TOML, as a site file, not a plan"),
        ("a.toml", '[[datums]]\nid = ""\n', "is TOML, as a site file, not a plan"),
        ("a.geojson", '{"type": "FeatureCollection"}', "is GeoJSON; import the NAME.building.yaml"),
        ("a.json", '{"format_version": "0.1", "anchors": {}, "levels": {}}', "is a site of Open-RMF's site editor"),
        ("a.ron", '(format_version: "0.1")', "is a site of Open-RMF's site editor"),
        ("map.yaml", "{image: a.pgm, resolution: 0.05, origin: [0, 0, 0]}", "is the map of one robot"),
        ("a.png", "\udc89PNG", "is no text; give the file of the plan"),
        ("a.yaml", "levels: [", "can't be read"),
        ("a.xml", "<model>", "can't be read"),
        ("a.xml", '<model><point name="P1"/></model>', "point 'P1' has no positionX"),
        ("a.json", '{"levels": [{"name": "L1"}], "name": "a"}', "does not have the structure of its format: KeyError"),
    ],
)
def test_a_file_that_is_not_a_plan_is_explained(name: str, text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=message):
        imported_site(written(tmp_path, name, text), 1.2)


def test_the_command_prints_a_site_that_check_accepts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan, made = written(tmp_path, "hall.xml", PLANT.format(x="positionX", y="positionY")), tmp_path / "site.toml"
    run("site", "import", plan)
    made.write_text(capsys.readouterr().out)
    run("check", made)
    command = [sys.executable, "-m", "deconflict", "site", "import", str(made)]
    wrong = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)


@pytest.mark.skipif(not RECORDINGS, reason="DECONFLICT_RECORDINGS is not set")
@pytest.mark.parametrize(
    ("name", "floors", "wanted"),
    [
        ("openrmf-hotel", 3, {"lift": 2, "door": 19}),
        ("openrmf-office", 1, {"charger": 2, "door": 3}),
        ("opentcs-demo01", 1, {"charger": 4, "dock": 8, "station": 3, "crossing": 2}),
    ],
)
def test_real_sites_are_imported_unchanged(name: str, floors: int, wanted: dict[str, int], tmp_path: Path) -> None:
    copy = tmp_path / f"{name}.json"
    copy.write_bytes((Path(RECORDINGS or "") / f"{name}.json").read_bytes())
    site = site_of(copy)
    assert len(site.datums) == floors
    found = kinds(site)
    assert {kind: found.get(kind, 0) for kind in wanted} == wanted


def test_the_picture_has_each_floor_and_names_a_path_that_cannot_be_written(tmp_path: Path) -> None:
    imported = imported_site(written(tmp_path, "works.building.yaml", BUILDING), 1.2)
    plan_picture = pytest.importorskip("deconflict.settings.importers.plan_picture")
    plan_picture.save_picture(imported.plan, imported.site, tmp_path / "works.png")
    width_px, height_px = struct.unpack(">II", (tmp_path / "works.png").read_bytes()[16:24])
    assert min(width_px, height_px) > 300
    with pytest.raises(PlanError, match=r"no/works\.png can't be written: No such file or directory"):
        plan_picture.save_picture(imported.plan, imported.site, tmp_path / "no" / "works.png")


def test_the_summary_says_what_was_drawn_and_what_was_not(tmp_path: Path) -> None:
    imported = imported_site(written(tmp_path, "works.building.yaml", BUILDING), 1.2)
    head, ground, upper, *others = summary_lines(imported.plan, imported.site)
    assert head == "works: an Open-RMF building with 2 floors"
    assert ground.startswith("  Ground: 1 door, 1 aisle, 1 charger, 1 dock, 1 parking place, 1 lift, 1 wall; x 4.4 to")
    assert upper == "  Upper: 1 lift; x -1.0 to 1.0 m, y -1.5 to 1.5 m"
    assert others[0] == "  left out: 1 swing of a door: a door is drawn as its doorway"
    assert others[1] == "  left out: 1 one-way lane: robots do not meet head-on there"
    assert others[-1].startswith("  look at: Ground: no two fiducials in common with the reference level Upper")
