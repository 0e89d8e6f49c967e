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
        ("shape = 'circle'\ndiameter_m = 31", ".diameter_m", "reading.largest_body_m = 30 m"),
        ("footprint_m = [[0, 0], [30.1, 0], [0, 1]]", ".footprint_m", "reading.largest_body_m = 30 m"),
        ("envelope_m = [1200, 800, 300]", ".envelope_m", "reading.largest_body_m = 30 m"),
        ("envelope_m = [1, 1, 300]", ".envelope_m", "reading.largest_body_m = 30 m"),
        (CIRCLE + "envelope_m = [1, 1, 300]", ".envelope_m", "reading.largest_body_m = 30 m"),
        ("envelope_m = [3, 1, 1]\noffset_m = [29, 0]", ".envelope_m", "reading.largest_body_m = 30 m"),
        ("offset_m = [0, 31]", ".offset_m", "reading.largest_body_m = 30 m"),
        ("loaded_envelope_m = [31, 1, 1]", ".loaded_envelope_m", "reading.largest_body_m = 30 m"),
        (TRAILERS.replace("hitch_m = 1", "hitch_m = 31"), ".trailers.hitch_m", "reading.largest_body_m = 30 m"),
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
        (f"parts = [{{ {BOX}, top_m = 1, offset_m = [-800, 0] }}]", ".parts", "reading.largest_body_m = 30 m"),
        (
            f"parts = [{{ {BOX}, top_m = 1, offset_m = [-16, 0] }}, {{ {BOX}, top_m = 1, offset_m = [16, 0] }}]",
            ".parts",
            "reading.largest_body_m = 30 m",
        ),
        (CIRCLE + "offset_m = [0, 800]", ".diameter_m", "reading.largest_body_m = 30 m"),
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


def test_a_larger_limit_allows_larger_bodies_and_a_smaller_one_refuses_defaults() -> None:
    def problems(limit_m: float) -> list[str]:
        site = f"""
            [reading]
            largest_body_m = {limit_m}
            [[vendors]]
            name = 'Round'
            default_envelope_m = [40, 4, 5]
            """
        try:
            site_from_toml(site.encode(), Path("site.toml"))
        except SiteError as error:
            return [problem.partition(":")[0] for problem in error.problems]
        return []

    assert problems(40) == []
    assert problems(39) == ["vendors.Round.default_envelope_m"]
    assert problems(0.9) == ["reading.default_envelope_m", "vendors.Round.default_envelope_m"]
    assert problems(101) == problems(0) == ["reading.largest_body_m"]
