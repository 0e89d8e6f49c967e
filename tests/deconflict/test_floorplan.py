from pathlib import Path
from typing import Any

import pytest

from deconflict.floorplan import matrix
from deconflict.site import Site, load, problems
from tests.deconflict.made_site import HALL, MARKS, put, sound, written

HIGH_PX = 1000.0


def pixel(x_m: float, y_m: float) -> list[float]:
    """An image of 20 pixels a metre, whose lower left corner is 2 m left of and 1 m below the origin."""
    return [20 * (x_m + 2), HIGH_PX - 20 * (y_m + 1)]


def planned(folder: Path, readings: dict[str, Any], image: str = "plan.png") -> Site:
    (folder / "plan.png").write_bytes(b"\x89PNG")
    plan = {"image": str(folder / image), "readings": readings}
    return load(written(put(sound(), "datums.0.plan", plan), folder))


@pytest.mark.parametrize("marks", [("door", "dock"), ("door", "dock", "gate"), tuple(MARKS)])
def test_the_image_is_placed_by_its_reference_points(marks: tuple[str, ...], tmp_path: Path) -> None:
    site = planned(tmp_path, {one: pixel(*MARKS[one]) for one in marks})
    assert problems(site) == []
    datum = site.datums[0]
    assert datum.id == HALL
    assert datum.plan
    a, b, c, d, e, f = matrix(datum.plan, datum)
    for x_m, y_m in ((7.0, 3.0), (-2.0, -1.0)):
        column, row = pixel(x_m, y_m)
        assert (a * column + c * row + e, b * column + d * row + f) == pytest.approx((x_m, y_m))


def test_rows_that_are_counted_upwards_are_found_out(tmp_path: Path) -> None:
    site = planned(tmp_path, {one: [20 * x, 20 * y] for one, (x, y) in MARKS.items()})
    assert problems(site) == [
        "datums[0].plan.readings: are turned over; count rows downwards from the image's upper left corner"
    ]


def test_a_wrong_reading_is_named(tmp_path: Path) -> None:
    readings = {one: pixel(*at) for one, at in MARKS.items()}
    readings["dock"][0] += 200
    problem = problems(planned(tmp_path, readings))[0]
    assert "datums[0].plan.readings." in problem
    assert "expected at most tolerance_m = 0.5" in problem


@pytest.mark.parametrize(("image", "message"), [("no.png", "there is no file"), ("plan.tiff", "expected a file named")])
def test_an_image_that_can_not_be_shown_is_named(image: str, message: str, tmp_path: Path) -> None:
    site = planned(tmp_path, {one: pixel(*at) for one, at in MARKS.items()}, image)
    assert [message in one for one in problems(site)] == [True]


def test_a_point_that_the_floor_does_not_have_is_named(tmp_path: Path) -> None:
    (problem,) = problems(planned(tmp_path, {"door": [0, 0], "window": [1, 1]}))
    assert problem == "datums[0].plan.readings: reads window, which datum 'Hall' does not have"
