from math import atan2, degrees, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod

from ingest.frames.projection import Projection
from ingest.settings import Datum

GEOD = Geod(ellps="WGS84")
SINGAPORE = (1.352, 103.82)
TROMSO = (69.65, 18.96)
BOSTON = (42.36, -71.06)
NOT_THE_DATE_LINE = (-16.5, 179.9999)


def projection(reference: tuple[float, float], *, relative: bool = False) -> Projection:
    kind = "latlon-relative" if relative else "latlon"
    return Projection(
        Datum.model_validate({"id": "f", "name": "f", "coordinates": kind, "reference_location": reference})
    )


@given(
    st.sampled_from([SINGAPORE, TROMSO, BOSTON, NOT_THE_DATE_LINE]),
    st.tuples(st.floats(-180, 180), st.floats(0, 100)),
    st.tuples(st.floats(-180, 180), st.floats(0, 100)),
)
def test_distances_are_those_of_the_geodesic_within_a_millimetre(
    reference: tuple[float, float], found: tuple[float, float], other: tuple[float, float]
) -> None:
    latitude, longitude = reference
    places = [GEOD.fwd(longitude, latitude, azimuth, distance_m)[:2] for azimuth, distance_m in (found, other)]
    _, _, true_m = GEOD.inv(*places[0], *places[1])
    metres = projection(reference).points(np.array([(lat, lon) for lon, lat in places]))
    assert np.hypot(*(metres[0] - metres[1])) == pytest.approx(true_m, abs=1e-3)


def test_x_is_north_and_y_is_east_and_the_floor_has_east_first() -> None:
    north, east = projection(BOSTON).points(np.array([(42.361, -71.06), (42.36, -71.059)]))
    assert north[0] == pytest.approx(0.0, abs=1e-3)
    assert north[1] == pytest.approx(GEOD.inv(-71.06, 42.36, -71.06, 42.361)[2], abs=1e-3)
    assert east[1] == pytest.approx(0.0, abs=1e-3)
    assert east[0] == pytest.approx(GEOD.inv(-71.06, 42.36, -71.059, 42.36)[2], abs=1e-3)


def test_relative_degrees_are_counted_from_the_reference_location() -> None:
    absolute = np.array([(42.3605, -71.0592), (42.36, -71.06)])
    relative = absolute - BOSTON
    np.testing.assert_allclose(
        projection(BOSTON, relative=True).points(relative), projection(BOSTON).points(absolute), atol=1e-6
    )


def test_the_yaw_of_a_left_handed_frame_is_set_right() -> None:
    """North is 0 and east a quarter turn in a left-handed frame; on the floor east is 0 and north a quarter turn."""
    yaws = [projection(BOSTON).yaw(yaw_rad) for yaw_rad in (0.0, pi / 2, pi, 0.1, np.nan)]
    np.testing.assert_allclose(yaws, [pi / 2, 0.0, -pi / 2, pi / 2 - 0.1, np.nan])


@given(st.floats(-180, 180))
def test_a_robot_that_drives_straight_on_keeps_its_yaw_along_its_path(bearing_deg: float) -> None:
    """A bearing is what a yaw from north towards east is."""
    lon, lat, _ = GEOD.fwd(BOSTON[1], BOSTON[0], bearing_deg, 20.0)
    chart = projection(BOSTON)
    here, there = chart.points(np.array([BOSTON, (lat, lon)]))
    heading = degrees(atan2(there[1] - here[1], there[0] - here[0]))
    yaw = degrees(chart.yaw(radians(bearing_deg)))
    assert (heading - yaw + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-3)


def test_degrees_that_are_nowhere_on_earth_come_out_infinite() -> None:
    assert np.isinf(projection(BOSTON).points(np.array([(1200.0, 5.0)]))).all()


def test_a_datum_in_degrees_needs_a_reference_location() -> None:
    with pytest.raises(ValueError, match="needs a reference_location"):
        Projection(Datum(id="f", name="hall", coordinates="latlon"))
