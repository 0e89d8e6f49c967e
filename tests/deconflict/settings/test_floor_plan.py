import asyncio
import shutil
from pathlib import Path
from typing import Any

import pytest

from deconflict.roles.service import run_in_one_process
from deconflict.settings.floor_plan import image_matrix
from deconflict.settings.site import Site
from deconflict.settings.site_file import fit_problems, load
from metrics.monitoring.exposition import render
from tests.helpers.made_site import HALL, MARKS, put, sound, written
from tests.helpers.patience import PATIENCE_S
from tests.helpers.plain_http import http_client

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
    site = planned(tmp_path, {mark: pixel(*MARKS[mark]) for mark in marks})
    assert fit_problems(site) == []
    datum = site.datums[0]
    assert datum.id == HALL
    assert datum.plan
    a, b, c, d, e, f = image_matrix(datum.plan, datum)
    for x_m, y_m in ((7.0, 3.0), (-2.0, -1.0)):
        column, row = pixel(x_m, y_m)
        assert (a * column + c * row + e, b * column + d * row + f) == pytest.approx((x_m, y_m))


def test_rows_counted_upwards_are_a_problem(tmp_path: Path) -> None:
    site = planned(tmp_path, {name: [20 * x, 20 * y] for name, (x, y) in MARKS.items()})
    assert fit_problems(site) == [
        "datum Hall: plan.readings: are upside down; count rows downwards from the image's upper left corner"
    ]


def test_a_wrong_reading_is_named(tmp_path: Path) -> None:
    readings = {name: pixel(*at) for name, at in MARKS.items()}
    readings["dock"][0] += 200
    problem = fit_problems(planned(tmp_path, readings))[0]
    assert "datum Hall: plan.readings." in problem
    assert "expected at most tolerance_m = 0.5" in problem


@pytest.mark.parametrize(("image", "message"), [("no.png", "there is no file"), ("plan.tiff", "expected a file named")])
def test_an_unusable_image_is_named(image: str, message: str, tmp_path: Path) -> None:
    site = planned(tmp_path, {name: pixel(*at) for name, at in MARKS.items()}, image)
    assert [message in fit_problem for fit_problem in fit_problems(site)] == [True]


def test_a_point_that_the_floor_does_not_have_is_named(tmp_path: Path) -> None:
    (problem,) = fit_problems(planned(tmp_path, {"door": [0, 0], "window": [1, 1]}))
    assert problem == "datum Hall: plan.readings: reads window, which datum 'Hall' does not have"


QUARTERS = """<svg xmlns="http://www.w3.org/2000/svg" width="880" height="560">
<rect width="440" height="280" fill="#f00"/><rect x="440" width="440" height="280" fill="#0f0"/>
<rect y="280" width="440" height="280" fill="#00f"/>
<rect x="440" y="280" width="440" height="280" fill="#ff0"/></svg>"""
MIDDLES = """() => {
  const canvas = document.querySelector("canvas"), pen = canvas.getContext("2d");
  const { data, width } = pen.getImageData(0, 0, canvas.width, canvas.height), found = {};
  for (let at = 0; at < data.length; at += 4) {
    const [r, g, b] = data.slice(at, at + 3), high = Math.max(r, g, b), low = Math.min(r, g, b);
    if (high - low < 40) continue;
    const name = [r, g, b].map((one) => (one > (high + low) / 2 ? 1 : 0)).join("");
    const one = (found[name] ??= { count: 0, x: 0, y: 0 });
    one.count += 1; one.x += (at / 4) % width; one.y += Math.floor(at / 4 / width);
  }
  return Object.fromEntries(Object.entries(found).filter(([, one]) => one.count > 5000)
    .map(([name, one]) => [name, [one.x / one.count, one.y / one.count]]));
}"""


def quarters(folder: Path) -> Site:
    """A hall whose plan has its upper left quarter red, upper right green, lower left blue and lower right yellow."""
    (folder / "plan.svg").write_text(QUARTERS)
    readings = {name: [20 * (x + 2), 560 - 20 * (y + 2)] for name, (x, y) in MARKS.items()}
    site = planned(folder, readings, "plan.svg")
    ports = {"receiver": site.receiver, "operator": site.operator}
    return site.model_copy(update={name: section.model_copy(update={"port": 0}) for name, section in ports.items()})


@pytest.mark.skipif(not shutil.which("chromium"), reason="chromium is not installed")
async def test_the_image_lies_below_the_map_the_right_way_up(tmp_path: Path) -> None:
    playwright = pytest.importorskip("playwright.async_api", reason="playwright drives the browser")
    async with run_in_one_process(quarters(tmp_path), tmp_path / "data", render) as (_, operator):
        address = f"http://127.0.0.1:{operator.port}"
        async with http_client(address) as client:
            floors = (await client.get("/site")).json()["floors"]
            plan = next(floor["plan"] for floor in floors if floor["id"] == HALL)
            image = await client.get(plan["image"])
            assert (image.text, image.headers["content-type"]) == (QUARTERS, "image/svg+xml")
            assert plan["matrix"] == pytest.approx([0.05, 0, 0, -0.05, -2, 26])
            assert (await client.get("/plans/yard")).status_code == 404
        async with playwright.async_playwright() as play:
            browser = await play.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = await browser.new_page()
            await page.goto(address)
            async with asyncio.timeout(PATIENCE_S):
                while len(middles := await page.evaluate(MIDDLES)) < 4:
                    await asyncio.sleep(0.1)
            await browser.close()
    red, green, blue, yellow = (middles[name] for name in ("100", "010", "001", "110"))
    assert red[0] < green[0]
    assert blue[0] < yellow[0]
    assert red[1] < blue[1]
    assert green[1] < yellow[1]
