from itertools import pairwise
from math import nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.languages.massrobotics import path_points
from ingest.languages.massrobotics.json_objects import PredictedLocation, Quaternion
from ingest.languages.massrobotics.path_points import absurd, destinations, path, yaw_rad
from ingest.languages.model import NO_PATH
from ingest.languages.rules import Findings
from tests.helpers.saying import angle
from tests.helpers.vectors import T, at

offsets_s = st.lists(st.floats(-100, 1000).map(lambda s: round(s, 3)), min_size=1, max_size=12)


def read_points(times_s: list[float]) -> list[PredictedLocation]:
    return [PredictedLocation.model_validate(at(t_s, x=float(i))) for i, t_s in enumerate(times_s)]


@given(offsets_s)
def test_a_path_keeps_its_order_and_its_findings_say_what_is_odd(offsets: list[float]) -> None:
    findings = Findings()
    read = path(read_points([T + offset for offset in offsets]), T, findings)
    assert [pose[1] for pose in read.poses] == list(range(len(offsets)))
    assert ("path-unordered" in findings) == any(b < a for a, b in pairwise(offsets))
    assert ("path-times-equal" in findings) == (len(set(offsets)) < len(offsets))
    assert ("path-too-far" in findings) == (max(offsets) > 11)
    assert ("path-too-many" in findings) == (len(offsets) > 10)
    assert ("path-past" in findings) == (max(offsets) <= 0 and min(offsets) < -1)


@given(offsets_s)
def test_destinations_come_in_the_order_of_their_times(offsets: list[float]) -> None:
    findings = Findings()
    read = destinations(read_points([T + offset for offset in offsets]), T, findings)
    assert [pose[0] for pose in read.poses] == pytest.approx([T + offset for offset in sorted(offsets)])
    assert ("destinations-unsorted" in findings) == (offsets != sorted(offsets))
    assert ("destinations-too-far" in findings) == (max(offsets) > 901)


def test_a_path_in_1970_is_no_finding_where_the_robot_itself_is_there() -> None:
    findings = Findings()
    path(read_points([101.0, 102.0]), 100.0, findings)
    assert findings == {}


@pytest.mark.parametrize(("height_m", "twice"), [(0.0, True), (1.5, False)])
def test_points_that_differ_in_height_alone_are_not_the_same_twice(height_m: float, twice: bool) -> None:
    findings = Findings()
    lift = [PredictedLocation.model_validate(at(T + 1.0, x=2.0, z=z_m)) for z_m in (0.0, height_m)]
    assert len(path(lift, T, findings).poses) == 2
    assert ("duplicate-items" in findings) == twice


@pytest.mark.parametrize("points", [None, []])
def test_no_points_are_no_path(points: list[PredictedLocation] | None) -> None:
    assert path(points, T, Findings()) is NO_PATH
    assert destinations(points, T, Findings()) is NO_PATH


@given(st.floats(-3.1, 3.1), st.floats(1e-3, 1e3))
def test_a_heading_does_not_depend_on_the_length_of_its_quaternion(turn_rad: float, scale: float) -> None:
    scaled = Quaternion(**{part: value * scale for part, value in angle(turn_rad).items()})
    assert yaw_rad(scaled, Findings()) == pytest.approx(turn_rad, abs=1e-9)


def test_half_a_turn_either_way_is_the_same_heading() -> None:
    assert abs(yaw_rad(Quaternion(**angle(pi)), Findings())) == pytest.approx(
        abs(yaw_rad(Quaternion(**angle(-pi)), Findings()))
    )


@pytest.mark.parametrize("position", [(nan, 0.0, 0.0), (0.0, 1.1e7, 0.0), (0.0, 0.0, -1e308)])
def test_a_position_off_the_earth_is_absurd(position: tuple[float, float, float]) -> None:
    assert absurd(*position)
    assert not absurd(0.0, 1e7, -1e7)


odd_points = st.builds(
    at,
    st.floats(T - 5, T + 20),
    x=st.floats(-1e3, 1e3) | st.just(2e7),
    angle=st.floats(-3, 3).map(angle)
    | st.sampled_from([None, {"x": 0, "y": 0, "z": 0.1, "w": 9}, dict.fromkeys("xyzw", 0.0)]),
    planarDatumUUID=st.sampled_from([None, "hall", "Yard"]),
    planarDatum=st.sampled_from([None, None, None, "hall"]),
)


@given(st.lists(odd_points, min_size=1, max_size=12))
def test_a_conforming_path_is_read_as_it_would_be_point_by_point(expected: list[dict[str, object]]) -> None:
    points = [PredictedLocation.model_validate(point) for point in expected]
    quick = Findings()
    read = path(points, T, quick)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(path_points, "_conforming_rows", lambda *_: None)
        slow = Findings()
        one_by_one = path(points, T, slow)
    assert repr(read) == repr(one_by_one)
    assert quick == slow
