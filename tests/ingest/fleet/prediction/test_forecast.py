from math import hypot, isnan, nan, pi
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from ingest.batch import Basis
from ingest.fleet.prediction.envelope import with_envelope
from ingest.fleet.prediction.forecast import forecast, matches
from ingest.fleet.prediction.forecast_model import Forecast, ForecastContext, RobotBody, Sighting, robot_body
from ingest.fleet.prediction.pace import Pace, Paces
from ingest.frames.frame_registry import Frame, FrameRegistry
from ingest.languages.massrobotics.parser import read
from ingest.languages.model import Status
from ingest.settings import Model, Part, Reading
from ingest.shapes import Shape, ShapePart
from ingest.sizes.stated_loads import LoadBox
from tests.helpers.saying import HALL, LOFT, points, status

NOW_S = 1_790_000_000.0
HERE = Sighting(NOW_S, 0, 1.0, 2.0, 0.0, 1.0)
BODY = RobotBody((1.0, 0.5, 0.4))
FRAMES = FrameRegistry((), ())


def frame_of(datum: str) -> tuple[Frame, int]:
    return FRAMES.frame("Alder", datum or HALL), 1 if datum == LOFT else 0


def ahead(here: Sighting = HERE, body: RobotBody = BODY, offset_s: float = 0.0, **fields: Any) -> Forecast:
    message = read(status("robot", NOW_S - offset_s, here.x_m, here.y_m, **fields))
    assert isinstance(message, Status)
    here = replace(here, clock_offset_s=offset_s)
    return forecast(message, here, ForecastContext(body, frame_of, Reading()), Paces(Pace(), here))


def straight(speed_mps: float = 1.0, late_s: float = 0.0) -> list[dict[str, Any]]:
    return points(*((NOW_S + late_s + i, 1.0 + speed_mps * i, 2.0, 0.0) for i in range(1, 11)))


def test_a_navigating_robot_follows_its_path() -> None:
    made_forecast = ahead(path=straight())
    assert made_forecast.basis is Basis.PATH
    np.testing.assert_allclose(np.array(made_forecast.knots)[:, 0], NOW_S + np.arange(11), atol=2e-3)
    np.testing.assert_allclose(np.array(made_forecast.knots)[:, 1], 1.0 + np.arange(11))
    assert (made_forecast.length_m, made_forecast.width_m, made_forecast.bottom_m, made_forecast.top_m) == (
        1.0,
        0.5,
        0.0,
        0.4,
    )


@pytest.mark.parametrize(
    "state",
    ["charging", "disabled", "offline", "waitingHumanEvent", "waitingExternalEvent", "waitingInternalEvent"],
)
def test_a_robot_in_any_other_state_stands_whatever_its_path(state: str) -> None:
    made_forecast = ahead(operationalState=state, path=straight())
    assert made_forecast.basis is Basis.STATIONARY
    assert len(made_forecast.knots) == 1


def test_an_idle_robot_departs_when_its_path_says_so() -> None:
    made_forecast = ahead(operationalState="idle", path=straight(late_s=3.0))
    assert (made_forecast.basis, made_forecast.findings) == (Basis.PATH, ())
    assert made_forecast.knots[-1][1] == pytest.approx(11.0)


@pytest.mark.parametrize(("speed_mps", "late_s"), [(1.0, -60.0), (0.0, 0.0), (0.008, 0.0)])
def test_an_idle_robot_stands_if_its_path_is_past_or_leads_nowhere(speed_mps: float, late_s: float) -> None:
    made_forecast = ahead(operationalState="idle", path=straight(speed_mps, late_s))
    assert (made_forecast.basis, len(made_forecast.knots), made_forecast.findings) == (Basis.STATIONARY, 1, ())


def test_a_robot_in_manual_mode_follows_its_velocity_and_not_its_path() -> None:
    made_forecast = ahead(operationalState="manualOverride", path=straight(-1.0))
    assert made_forecast.basis is Basis.VELOCITY
    assert made_forecast.knots[-1][1] == pytest.approx(11.0)
    assert ahead(Sighting(NOW_S, 0, 1.0, 2.0, 0.0), operationalState="manualOverride").basis is Basis.STATIONARY


@pytest.mark.parametrize("code", ["Robot Stuck", "robot_safety_stop", "E-Stop pressed", "emergencyStop"])
def test_a_blocking_error_makes_an_obstacle(code: str) -> None:
    assert ahead(path=straight(), errorCodes=[code]).basis is Basis.STATIONARY


def test_any_other_error_does_not_make_an_obstacle() -> None:
    assert ahead(path=straight(), errorCodes=["battery low"]).basis is Basis.PATH


def test_path_times_are_corrected_by_the_clock() -> None:
    made_forecast = ahead(path=straight(late_s=-3.0), offset_s=3.0)
    np.testing.assert_allclose(np.array(made_forecast.knots)[:, 0], NOW_S + np.arange(11), atol=2e-3)


def test_points_already_past_are_left_out() -> None:
    made_forecast = ahead(path=straight(late_s=-3.5))
    assert made_forecast.knots[1][0] == pytest.approx(NOW_S + 0.5)
    assert "path-retimed" not in made_forecast.findings


@pytest.mark.parametrize(
    "times_s",
    [[-20, -19, -18], [3, 2, 1], [5, 5, 5], [5, 5, 6], [-NOW_S, -NOW_S, -NOW_S]],
    ids=["past", "unordered", "equal", "two equal", "1970"],
)
def test_useless_times_are_replaced_by_the_speed_along_the_points(times_s: list[float]) -> None:
    given = points(*((NOW_S + t, 1.0 + 2.0 * (i + 1), 2.0, 0.0) for i, t in enumerate(times_s)))
    made_forecast = ahead(path=given)
    assert made_forecast.findings == ("path-retimed",)
    np.testing.assert_allclose(np.array(made_forecast.knots)[:, 0] - NOW_S, [0, 2, 4, 6, 10])
    np.testing.assert_allclose(np.array(made_forecast.knots)[:, 1], [1, 3, 5, 7, 11])


@pytest.mark.parametrize(
    ("speed_mps", "most_mps", "after_s"),
    [(0.0, None, 4.5), (0.05, None, 4.45125), (None, None, 4.0), (0.0, 2.0, 3.0), (0.5, 2.0, 8.0), (3.0, 2.0, 2.0)],
)
def test_a_robot_that_stands_or_sets_off_follows_a_path_with_useless_times_at_its_usual_pace(
    speed_mps: float | None, most_mps: float | None, after_s: float
) -> None:
    here = Sighting(NOW_S, 0, 1.0, 2.0, 0.0, speed_mps)
    past = points(*((NOW_S - 20, 1.0 + i, 2.0, 0.0) for i in range(1, 5)))
    made_forecast = ahead(here, RobotBody((1.0, 0.5, 0.4), max_speed_mps=most_mps), path=past)
    assert (made_forecast.basis, made_forecast.findings) == (Basis.PATH, ("path-retimed",))
    t_s, x_m, _, _ = made_forecast.knots[4]
    assert (t_s - NOW_S, x_m) == pytest.approx((after_s, 5.0))


@pytest.mark.parametrize("times_s", [[5, 4, 3, 2, 1], [1, 3, 2, 4, 5], [1, 2, 2, 3, 4, 5, 1]])
def test_points_are_followed_in_the_order_of_their_times_if_that_is_shorter(times_s: list[int]) -> None:
    made_forecast = ahead(path=points(*((NOW_S + s, 1.0 + s, 2.0, 0.0) for s in times_s)))
    assert made_forecast.findings == ()
    np.testing.assert_allclose(np.array(made_forecast.knots)[:, 0] - NOW_S, [0, 1, 2, 3, 4, 5, 10])
    np.testing.assert_allclose(np.array(made_forecast.knots)[:, 1], [1, 2, 3, 4, 5, 6, 11])


def test_a_repeated_point_leaves_a_planned_wait() -> None:
    made_forecast = ahead(path=points(*((NOW_S + s, x, 2.0, 0.0) for s, x in ((1, 2.0), (1, 2.0), (8, 2.0), (9, 3.0)))))
    np.testing.assert_allclose(np.array(made_forecast.knots)[1:, :2] - (NOW_S, 0.0), [(1, 2), (8, 2), (9, 3)])


def test_a_path_is_used_up_to_an_impossible_jump() -> None:
    given = points((NOW_S + 1, 2.0, 2.0, 0.0), (NOW_S + 2, 3.0, 2.0, 0.0), (NOW_S + 3, 90.0, 2.0, 0.0))
    made_forecast = ahead(path=given, body=RobotBody((1.0, 0.5, 0.4), max_speed_mps=1.5))
    assert made_forecast.findings == ("path-contradicts-motion",)
    assert made_forecast.knots[2][1] == pytest.approx(3.0)
    assert made_forecast.knots[-1][1] == pytest.approx(11.0)


def test_a_path_that_jumps_at_once_gives_way_to_the_velocity() -> None:
    made_forecast = ahead(path=points((NOW_S + 1, 500.0, 2.0, 0.0)))
    assert made_forecast.basis is Basis.VELOCITY


def test_a_sparse_path_beyond_the_horizon_is_used_as_far_as_it_matters() -> None:
    given = points(*((NOW_S + t, 1.0 + t, 2.0, 0.0) for t in (10, 20, 30, 40, 50, 60, 70)))
    made_forecast = ahead(path=given)
    assert made_forecast.basis is Basis.PATH
    assert made_forecast.knots[-1][0] - NOW_S == pytest.approx(40)


def test_a_path_may_change_floor() -> None:
    given = straight()
    for point in given[5:]:
        point["planarDatumUUID"] = LOFT
    assert ahead(path=given).floors == (0,) * 6 + (1,) * 5


def test_velocity_gives_a_straight_line_or_an_arc() -> None:
    made_forecast = ahead()
    assert made_forecast.basis is Basis.VELOCITY
    assert made_forecast.knots[-1] == pytest.approx([NOW_S + 10, 11.0, 2.0, 0.0])
    turning = ahead(Sighting(NOW_S, 0, 1.0, 2.0, 0.0, 1.0, pi / 10))
    radius_m = 1.0 / (pi / 10)
    assert turning.knots[-1][1:] == pytest.approx([1.0, 2.0 + 2 * radius_m, pi])


def test_a_speed_without_a_heading_leads_nowhere() -> None:
    for state in ("navigating", "manualOverride"):
        made_forecast = ahead(Sighting(NOW_S, 0, 1.0, 2.0, nan, 1.0), operationalState=state)
        assert (made_forecast.basis, made_forecast.knots) == (Basis.STATIONARY, ((NOW_S, 1.0, 2.0, 0.0),))


def test_a_robot_heads_for_its_destination_when_nothing_else_is_known() -> None:
    still = Sighting(NOW_S, 0, 1.0, 2.0, nan)
    made_forecast = ahead(still, destinations=points((NOW_S + 100, 1.0, 12.0, 0.0), (NOW_S + 5, 1.0, 7.0, 0.0)))
    assert made_forecast.basis is Basis.DESTINATION
    assert made_forecast.knots[-1][:3] == pytest.approx([NOW_S + 5, 1.0, 7.0], abs=2e-3)
    assert made_forecast.knots[0][3] == pytest.approx(pi / 2)


def test_a_destination_beyond_fifteen_minutes_is_not_used() -> None:
    still = Sighting(NOW_S, 0, 1.0, 2.0, 0.0)
    assert ahead(still, destinations=points((NOW_S + 1000, 1.0, 12.0, 0.0))).basis is Basis.STATIONARY


def test_without_any_heading_the_circumscribed_square_stands() -> None:
    made_forecast = ahead(Sighting(NOW_S, 0, 1.0, 2.0, nan), operationalState="idle")
    assert made_forecast.length_m == made_forecast.width_m == pytest.approx(hypot(1.0, 0.5))
    assert not isnan(made_forecast.knots[0][3])


def test_an_envelope_that_is_not_centred_leads_the_location() -> None:
    here = Sighting(NOW_S, 0, 1.0, 2.0, pi / 2, 0.0)
    made_forecast = ahead(here, RobotBody((2.9, 1.0, 0.0), (1.15, 0.0)), operationalState="idle")
    assert made_forecast.knots[0][1:3] == pytest.approx([1.0, 3.15])
    assert (made_forecast.bottom_m, made_forecast.top_m) == (-np.inf, np.inf)


def test_the_body_follows_the_load_where_the_site_says_how() -> None:
    model = Model(envelope_m=(1.0, 1.0, 0.5), loaded_envelope_m=(1.4, 1.2, 1.8), loaded_offset_m=(0.2, 0.0))
    reported = RobotBody((9.0, 9.0, 9.0), (0.5, 0.0), 1.5)
    assert robot_body(model, reported, False, None) == RobotBody((1.0, 1.0, 0.5), (0.5, 0.0), 1.5)
    assert robot_body(model, reported, True, None) == RobotBody((1.4, 1.2, 1.8), (0.2, 0.0), 1.5)
    assert robot_body(Model(), reported, True, None) == reported
    assert robot_body(Model(offset_m=(0.0, 0.0)), reported, False, None).offset_m == (0.0, 0.0)


def test_a_load_that_a_robot_reports_extends_its_body() -> None:
    longer = robot_body(Model(), RobotBody((1.0, 0.8, 0.5)), True, LoadBox(-1.5, 0.5, -0.6, 0.2, 1.8))
    assert longer.envelope_m == pytest.approx((2.0, 1.0, 1.8))
    assert longer.offset_m == pytest.approx((-0.5, -0.1))


def test_error_words_match_whatever_their_spelling() -> None:
    assert matches(("ROBOT-LOST",), ("lost",))
    assert matches(("safetyStop",), ("safety stop",))
    assert not matches((), ("lost",))


REPORTED = RobotBody((1.0, 1.0, 1.0))


def test_a_footprint_is_drawn_from_the_location_and_its_envelope_from_its_middle() -> None:
    model = Model(footprint_m=((2.0, 0.0), (-1.0, 1.0), (-1.0, -0.5)), envelope_m=(9.0, 9.0, 1.5))
    body = robot_body(model, REPORTED, False, None)
    assert (body.envelope_m, body.offset_m) == ((3.0, 1.5, 1.5), (0.5, 0.25))
    assert body.shape == Shape.polygon([(1.5, -0.25), (-1.5, 0.75), (-1.5, -0.75)])


def test_a_load_is_a_part_that_comes_and_goes() -> None:
    truck = Part(length_m=2.0, width_m=1.0, bottom_m=0.5, top_m=2.0)
    load = Part(shape="circle", diameter_m=1.0, offset_m=(1.5, 0.0), bottom_m=1.0, top_m=3.0, load=True)
    model = Model(parts=(truck, load))
    empty, loaded = (robot_body(model, REPORTED, is_loaded, None) for is_loaded in (False, True))
    assert (empty.envelope_m, empty.lift_m) == ((2.0, 1.0, 1.5), 0.5)
    assert (loaded.envelope_m, loaded.offset_m) == ((3.0, 1.0, 2.5), (0.5, 0.0))
    assert loaded.shape is not None
    assert loaded.shape.parts[1] == ShapePart(((1.0, 0.0),), 0.5, 0.5, 2.5)


def test_a_shape_without_a_heading_is_the_circle_that_holds_it() -> None:
    body = robot_body(Model(footprint_m=((2.0, 0.0), (-1.0, 1.0), (-1.0, -0.5))), REPORTED, False, None)
    made = with_envelope(Basis.STATIONARY, [(0.0, 5.0, 6.0, nan)], (0,), body, 0.0, ())
    assert made.knots == ((0.0, 5.0, 6.0, 0.0),)
    assert made.shape == Shape.circle(made.length_m)
    assert made.length_m >= 2 * 2.0


def test_a_reported_load_is_a_part_of_a_shape() -> None:
    load = LoadBox(-0.5, 0.5, -0.6, 0.6, 1.8)
    body = robot_body(Model(shape="circle", diameter_m=0.8), REPORTED, True, load)
    assert body.shape is not None
    assert body.shape.parts[1].outline_m == ((0.5, 0.6), (-0.5, 0.6), (-0.5, -0.6), (0.5, -0.6))
    assert body.envelope_m == (1.0, 1.2, 1.8)
