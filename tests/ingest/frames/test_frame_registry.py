from math import pi, radians
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pyproj import Geod

from ingest.batch import Floats
from ingest.frames.angles import turn_between
from ingest.frames.fitting import FitError
from ingest.frames.frame_registry import Frame, FrameRegistry, fit_map
from ingest.frames.transforms import Affine
from ingest.settings import NIL_DATUM, Datum, Vendor, VendorMap
from tests.ingest.frames.made_maps import HALL, jolts, seeds, similarities, similarity

POINTS = [f"mark-{row}" for row in range(len(HALL))]
METRES = Datum.model_validate(
    {
        "id": "HALL",
        "name": "Hall",
        "reference_points": [{"id": name, "x": x, "y": y} for name, (x, y) in zip(POINTS, HALL, strict=True)],
    }
)
HOME = (42.36, -71.06)
DEGREES = Datum.model_validate(
    {
        "id": "yard",
        "name": "Yard",
        "coordinates": "latlon",
        "reference_location": HOME,
        "reference_points": [{"id": "a", "x": 42.36, "y": -71.06}, {"id": "b", "x": 42.361, "y": -71.059}],
    }
)


def own_map(readings: Floats, *, datum: str = "own", **fields: Any) -> VendorMap:
    named = {name: tuple(reading) for name, reading in zip(POINTS, readings.tolist(), strict=False)}
    return VendorMap(datum=datum, site_datum="hall", readings=named, **fields)


def frames(*maps: VendorMap) -> FrameRegistry:
    return FrameRegistry([METRES, DEGREES], [Vendor(name="acme", maps=maps)])


def placed(frame: Frame, poses: Floats) -> Floats:
    return np.array([frame.pose(*pose) for pose in poses.tolist()])


def as_read(truth: Affine, floor: Floats) -> Floats:
    return np.asarray((floor - truth.shift) @ np.linalg.inv(truth.matrix).T, np.float64)


@given(similarities, st.integers(2, 6), st.floats(-3, 3))
def test_a_pose_on_the_vendors_map_is_placed_on_the_floor(truth: Affine, count: int, yaw_rad: float) -> None:
    frame = frames(own_map(as_read(truth, HALL[:count]), mirrored=truth.mirrored)).frame("acme", "own")
    assert (frame.floor, frame.known, frame.comparable) == ("hall", True, True)
    place = np.array([[17.0, 9.0], [17.0 + np.cos(yaw_rad), 9.0 + np.sin(yaw_rad)]])
    read = as_read(truth, place)
    sent = np.array([[*read[0], np.arctan2(*(read[1] - read[0])[::-1])]])
    np.testing.assert_allclose(placed(frame, sent), [[17.0, 9.0, yaw_rad]], atol=1e-6)


@given(seeds, st.floats(0, 40), st.floats(0, 25), st.floats(-3, 3))
def test_a_heading_is_where_a_short_step_leads_even_through_adjust(
    seed: int, x: float, y: float, yaw_rad: float
) -> None:
    mirrored = similarity(radians(70), 0.5, (3.0, 4.0), mirrored=True)
    readings = as_read(mirrored, HALL + jolts(6, 0.1, seed))
    frame = frames(own_map(readings, mirrored=True)).frame("acme", "own")
    start = as_read(mirrored, np.array([[x, y]]))[0]
    step = 1e-5 * np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    poses = np.array([[*start, yaw_rad], [*(start + step), yaw_rad], [*(start - step), yaw_rad]])
    found = placed(frame, poses)
    assume(np.ptp(found[:, 2]) < 1e-12)  # no edge of a triangle passes between
    led = found[1] - found[2]
    turn = np.arctan2(led[1], led[0]) - found[0, 2]
    assert (turn + pi) % (2 * pi) - pi == pytest.approx(0.0, abs=1e-6)


def test_a_mirrored_map_turns_the_other_way() -> None:
    frame = frames(own_map(HALL * (1.0, -1.0), mirrored=True)).frame("acme", "own")
    here, turned = placed(frame, np.array([[5.0, -2.0, 0.0], [5.0, -2.0, 0.3]]))
    np.testing.assert_allclose(here, [5.0, 2.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(turned, [5.0, 2.0, -0.3], atol=1e-9)


def test_two_points_are_mirrored_if_the_site_file_says_so() -> None:
    readings = HALL[:2] * (1.0, -1.0)
    place = np.array([[10.0, -7.0, 0.3]])
    values = placed(frames(own_map(readings, mirrored=True)).frame("acme", "own"), place)
    untold = placed(frames(own_map(readings)).frame("acme", "own"), place)
    np.testing.assert_allclose(values, [[10.0, 7.0, -0.3]], atol=1e-9)
    assert np.hypot(*(untold - values)[0, :2]) > 10


def test_an_unknown_heading_stays_unknown_in_every_frame() -> None:
    poses = np.array([[1.0, 2.0, np.nan]])
    by_map = frames(own_map(HALL)).frame("acme", "own")
    assert np.isnan(placed(by_map, poses)[0, 2])
    np.testing.assert_allclose(placed(by_map, poses)[0, :2], [1.0, 2.0], atol=1e-9)
    for datum in ("hall", "yard", "elsewhere"):
        assert np.isnan(placed(frames().frame("acme", datum), poses)[0, 2])


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("count", [2, 3, 6])
def test_a_frame_is_mirrored_where_turns_go_the_other_way(count: int, mirrored: bool) -> None:
    readings = HALL[:count] * (1.0, -1.0 if mirrored else 1.0)
    found = frames(own_map(readings, mirrored=mirrored))
    for datum, (x, y) in (("own", tuple(readings[1])), ("hall", (1.0, 2.0)), ("yard", HOME), ("elsewhere", (1.0, 2.0))):
        frame = found.frame("acme", datum)
        (_, _, before), (_, _, after) = frame.pose(x, y, 0.3), frame.pose(x, y, 0.4)
        assert frame.mirrored == (turn_between(before, after) < 0) == (mirrored if datum == "own" else datum == "yard")


def test_a_datum_in_metres_is_the_floors_frame() -> None:
    pose = 1.0, 2.0, 0.5
    assert frames().frame("acme", "hall").pose(*pose) == pose
    assert frames().frame("acme", "elsewhere").pose(*pose) == pose


def test_a_datum_in_degrees_is_left_handed() -> None:
    """At the reference location, facing north-east by an eighth turn from north towards east."""
    here = placed(frames().frame("acme", "yard"), np.array([[*HOME, pi / 4], [*HOME, 0.0]]))
    np.testing.assert_allclose(here, [[0.0, 0.0, pi / 4], [0.0, 0.0, pi / 2]], atol=1e-9)


def test_a_vendors_metres_fit_reference_points_in_degrees() -> None:
    vendor_map = VendorMap(datum="own", site_datum="yard", readings={"a": (0.0, 0.0), "b": (0.0, 138.3)})
    frame = frames(vendor_map).frame("acme", "own")
    assert frame.floor == "yard"
    a, b = placed(frame, np.array([[0.0, 0.0, 0.0], [0.0, 138.3, 0.0]]))
    true_m = Geod(ellps="WGS84").inv(-71.06, 42.36, -71.059, 42.361)[2]
    np.testing.assert_allclose(a[:2], [0.0, 0.0], atol=1e-6)
    assert np.hypot(b[0], b[1]) == pytest.approx(true_m, abs=1e-3)
    assert b[1] > b[0] > 0


def test_a_vendors_own_map_goes_before_the_sites_datum_of_that_name() -> None:
    found = frames(own_map(HALL + 100.0, datum="hall"))
    pose = 110.0, 105.0, 0.0
    np.testing.assert_allclose(found.frame("acme", "hall").pose(*pose), [10.0, 5.0, 0.0], atol=1e-9)
    assert found.frame("other", "hall").pose(*pose) == pose


def test_what_the_site_does_not_know_is_a_floor_of_its_own_for_all_who_name_it() -> None:
    first, other = frames().frame("acme", "svy21"), FrameRegistry([], []).frame("bolt", "svy21")
    assert (first.floor, first.known, first.comparable) == ("svy21", False, True)
    assert other.floor == first.floor


@pytest.mark.parametrize("datum", ["", NIL_DATUM])
def test_a_missing_datum_is_compared_with_nothing_however_few_maps_there_are(datum: str) -> None:
    frame = frames(own_map(HALL)).frame("acme", datum)
    assert (frame.floor, frame.known, frame.comparable) == ("unknown:acme", False, False)


def test_a_map_may_stand_for_a_vendor_that_sends_no_datum() -> None:
    found = frames(own_map(HALL, datum=""))
    assert found.frame("acme", "").floor == "hall"
    assert not found.frame("other", "").comparable


def test_readings_that_fit_nothing_are_refused_with_the_vendor_and_the_datum() -> None:
    with pytest.raises(FitError, match=r"vendor 'acme', map of 'Hall': readings of at least two .*, found 1"):
        frames(own_map(HALL[:1]))


def test_reading_a_point_that_is_not_there_is_refused() -> None:
    stray = VendorMap(datum="own", site_datum="hall", readings={"mark-0": (0, 0), "mark-77": (1, 1)})
    with pytest.raises(FitError, match="reads mark-77, which datum 'Hall' does not have"):
        fit_map(stray, METRES)


def test_reference_points_that_are_nowhere_on_earth_are_refused() -> None:
    a, b = DEGREES.reference_points
    lost = DEGREES.model_copy(update={"reference_points": (a.model_copy(update={"x": 500.0}), b)})
    vendor_map = VendorMap(datum="own", site_datum="yard", readings={"a": (0, 0), "b": (1, 1)})
    with pytest.raises(FitError, match="nowhere on Earth; x is latitude"):
        fit_map(vendor_map, lost)


UUID = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
SPELLINGS = [UUID, UUID.upper(), UUID.replace("-", ""), f"{{{UUID}}}", f"urn:uuid:{UUID}"]


@pytest.mark.parametrize("sent", SPELLINGS)
@pytest.mark.parametrize("in_site", SPELLINGS)
def test_a_datum_is_the_same_floor_however_its_uuid_is_spelt(in_site: str, sent: str) -> None:
    hall = Datum.model_validate(METRES.model_dump() | {"id": in_site})
    readings = dict(zip(POINTS, HALL.tolist(), strict=True))
    own = VendorMap.model_validate({"datum": in_site, "site_datum": hall.id, "readings": readings})
    registry = FrameRegistry([hall], [Vendor(name="Alder", maps=(own,))])
    found = registry.frame("Basalt", sent.lower())
    assert (found.floor, found.known) == (UUID, True)
    assert registry.frame("Alder", sent.lower()).transform is not None
    assert FrameRegistry([], []).frame("Alder", sent.lower()).floor == UUID


def test_a_nil_datum_is_nowhere_however_it_is_spelt() -> None:
    assert not FrameRegistry([], []).frame("Alder", NIL_DATUM.replace("-", "")).comparable


def test_a_location_on_a_datum_in_degrees_is_known_to_be_however_its_uuid_is_spelt() -> None:
    registry = FrameRegistry([DEGREES.model_copy(update={"id": UUID})], [])
    assert registry.is_in_degrees(UUID.replace("-", ""))
    assert not registry.is_in_degrees("hall")
