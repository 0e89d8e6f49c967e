from pathlib import Path

import pytest

from deconflict.settings.site_file import SiteError, site_from_toml

CIRCLE = "shape = 'circle'\ndiameter_m = 0.8\n"
BOX = "length_m = 1, width_m = 1, bottom_m = 0"
TRAILERS = "trailers = { count = 2, length_m = 1, width_m = 1, hitch_m = 1 }"


@pytest.mark.parametrize(
    ("model", "key", "problem"),
    [
        ("shape = 'circle'", "", "need each other"),
        ("diameter_m = 1", "", "need each other"),
        (CIRCLE + "footprint_m = [[0, 0], [1, 0], [0, 1]]", "", "two shapes"),
        ("shape = 'circle'\ndiameter_m = 31", ".diameter_m", "less than or equal to 30"),
        ("footprint_m = [[0, 0], [1, 0], [0, 1], [1, 1]]", ".footprint_m", "crosses itself"),
        ("footprint_m = [[0, 0], [1, 0], [2, 0]]", ".footprint_m", "no area"),
        (f"parts = [{{ {BOX}, top_m = 0 }}]", ".parts[0]", "below top_m"),
        (
            f"parts = [{{ {BOX.replace('= 0', '= -1')}, top_m = 1 }}]",
            ".parts[0].bottom_m",
            "or equal to 0",
        ),
        ("parts = [{ length_m = 1, bottom_m = 0, top_m = 1 }]", ".parts[0]", "needs length_m and width_m"),
        ("parts = [" + f"{{ {BOX}, top_m = 1 }}, " * 9 + "]", ".parts", "at most 8"),
        (f"parts = [{{ {BOX}, top_m = 1, load = true }}]", "", "not a load"),
        (CIRCLE + f"parts = [{{ {BOX}, top_m = 1 }}]", "", "parts replace"),
        (f"parts = [{{ {BOX}, top_m = 1, offset_m = [-800, 0] }}]", "", "larger than 30 m"),
        (
            f"parts = [{{ {BOX}, top_m = 1, offset_m = [-16, 0] }}, {{ {BOX}, top_m = 1, offset_m = [16, 0] }}]",
            "",
            "larger than 30 m",
        ),
        (CIRCLE + "offset_m = [0, 800]", "", "larger than 30 m"),
        (TRAILERS.replace("count = 2", "count = 0"), ".trailers.count", "greater than 0"),
        (TRAILERS.replace("length_m = 1", "length_m = 0"), ".trailers.length_m", "greater than 0"),
        (TRAILERS.replace("count", "number = 2, count"), ".trailers.number", "expected one of count, length_m"),
    ],
)
def test_a_bad_shape_is_named_by_its_key(model: str, key: str, problem: str) -> None:
    site = f"[[vendors]]\nname = 'Round'\n[vendors.models.R1]\n{model}\n"
    with pytest.raises(SiteError) as error:
        site_from_toml(site.encode(), Path("site.toml"))
    (line,) = error.value.problems
    assert line.startswith(f"vendors.Round.models.R1{key}: ")
    assert problem in line
