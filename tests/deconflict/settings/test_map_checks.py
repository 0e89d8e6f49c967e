import numpy as np
import pytest

from deconflict.settings.map_checks import datum_problems, map_problems
from ingest.settings import Datum, VendorMap
from tests.helpers.made_site import HALL, MARKS, sound

DATUM = Datum.model_validate(sound()["datums"][0])


def told(readings: dict[str, tuple[float, float]], *, mirrored: bool = False, tolerance_m: float = 0.25) -> list[str]:
    vendor_map = VendorMap(datum="own", site_datum=HALL, readings=readings, mirrored=mirrored, tolerance_m=tolerance_m)
    return list(map_problems(vendor_map, DATUM))


def turned(count: int, *, scale: float = 1.0, mirrored: bool = False) -> dict[str, tuple[float, float]]:
    """The vendor's map lies a quarter turn off, in another unit."""
    sign = -1 if mirrored else 1
    return {name: (scale * y, -sign * scale * x) for name, (x, y) in list(MARKS.items())[:count]}


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("scale", [1.0, 20.0, 1000.0, 39.37])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_map_in_any_unit_passes_and_a_mirrored_one_if_declared(count: int, scale: float, mirrored: bool) -> None:
    assert told(turned(count, scale=scale, mirrored=mirrored), mirrored=mirrored) == []


@pytest.mark.parametrize("count", [3, 4])
def test_only_a_mirrored_map_is_to_be_declared_mirrored(count: int) -> None:
    (silent,) = told(turned(count, mirrored=True))
    assert silent.startswith("mirrored: the readings are mirrored; set mirrored = true")
    (false,) = told(turned(count), mirrored=True)
    assert false == "mirrored: found true, but the readings are not mirrored"


def test_the_residual_of_the_global_fit_counts_though_adjust_would_hide_it() -> None:
    readings = turned(4)
    readings["gate"] = readings["gate"][0] + 1.6, readings["gate"][1]
    (problem,) = told(readings)
    assert problem.startswith("readings.")
    assert "expected at most tolerance_m = 0.25" in problem
    assert told(readings, tolerance_m=0.6) == []


def test_points_have_the_names_that_people_know() -> None:
    points = tuple(point.model_copy(update={"name": f"Pillar {point.id}"}) for point in DATUM.reference_points)
    datum = DATUM.model_copy(update={"reference_points": points})
    readings = turned(4)
    readings["gate"] = readings["gate"][::-1]
    (problem,) = map_problems(VendorMap(datum="own", site_datum=HALL, readings=readings), datum)
    assert problem.startswith(
        "readings.gate: this reading of Pillar gate has x and y exchanged; the fit of all misses Pi"
    )


def test_a_stretch_by_three_points_is_a_wrong_reading_until_a_fourth_confirms_it() -> None:
    stretched = {name: (1.05 * x, y) for name, (x, y) in MARKS.items()}
    three = dict(list(stretched.items())[:3])
    (problem,) = told(three)
    assert problem.startswith("readings: the fit stretches one direction 5.0 % more than another")
    assert told(stretched) == []


def test_points_too_near_each_other_for_their_residuals_are_named() -> None:
    reference = DATUM.reference_points
    twin = reference[0].model_copy(update={"id": "hinge", "x": 0.4, "y": 0.4})
    datum = DATUM.model_copy(update={"reference_points": (*reference, twin)})
    vendor_map = VendorMap(datum="own", site_datum=HALL, readings={**MARKS, "hinge": (0.6, 0.2)})
    (problem,) = map_problems(vendor_map, datum)
    assert "door" in problem
    assert "hinge" in problem
    assert "bends the map" in problem


def test_collinear_points_are_named() -> None:
    (problem,) = told({"door": (0.0, 0.0), "dock": (10.0, 0.0), "pillar": (20.0, 0.0)})
    assert problem.startswith("readings: the readings of door, dock, pillar lie on one line")


def test_reference_points_in_metres_and_near_ones_in_degrees_pass() -> None:
    assert list(datum_problems(DATUM)) == []
    assert list(datum_problems(Datum.model_validate(sound()["datums"][1]))) == []


def test_absolute_degrees_in_a_relative_datum_are_a_problem() -> None:
    yard = Datum.model_validate({**sound()["datums"][1], "coordinates": "latlon-relative"})
    (problem,) = datum_problems(yard)
    assert problem.startswith("reference_points.post: lies more than 20 km from reference_location")
    assert problem.endswith("(latlon-relative)")
    point = yard.reference_points[0].model_copy(update={"x": 0.001, "y": 0.001})
    assert list(datum_problems(yard.model_copy(update={"reference_points": (point,)}))) == []


def test_survey_noise_of_centimetres_passes() -> None:
    noise = np.random.default_rng(7).normal(0, 0.03, (4, 2))
    assert told({name: (x + n[0], y + n[1]) for (name, (x, y)), n in zip(MARKS.items(), noise, strict=True)}) == []
