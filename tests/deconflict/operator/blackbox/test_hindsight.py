"""What robots did by their reports, where they change their height."""

from math import inf

import pytest

from deconflict.operator.blackbox.hindsight import (
    RecordedTrack,
    ReportedPose,
    avoiding_delays_s,
    nearest_approach,
    row_at,
)

CLEARANCE_M = 0.3


def track(*reports: tuple[float, float, float, float], floors: tuple[int, ...] = ()) -> RecordedTrack:
    """A robot of 1 x 1 x 1 m, by time, x, y and bottom."""
    rows = zip(reports, floors or (0,) * len(reports), strict=True)
    known = [ReportedPose(t, x, y, 0.0, floor, bottom, bottom + 1.0) for (t, x, y, bottom), floor in rows]
    return RecordedTrack("A", "acme", known, 1.0, 1.0)


def stands(bottom_m: float) -> RecordedTrack:
    return track(*((float(t), 5.0, 0.0, bottom_m) for t in range(60)))


def passes(*bottoms_m: float) -> RecordedTrack:
    """It drives at 1 m/s through x = 5 at 30 s, at heights that it has for 5 s each from 20 s on."""
    return track(
        *((float(t), t - 25.0, 0.0, bottoms_m[max(min((t - 20) // 5, len(bottoms_m) - 1), 0)]) for t in range(60))
    )


@pytest.mark.parametrize(("bottom_m", "meets"), [(0.0, True), (0.9, True), (1.2, False), (5.0, False)])
def test_a_robot_that_passes_above_another_does_not_meet_it(bottom_m: float, meets: bool) -> None:
    a, b = passes(bottom_m).forecasts(), stands(0.0).forecasts()
    assert (nearest_approach(a, b, CLEARANCE_M, 0.0, 59.0) is not None) is meets
    assert avoiding_delays_s(a, b, CLEARANCE_M, 30.0) == ((None, None) if meets else (0.1, 0.1))


def test_a_robot_meets_others_at_the_height_that_it_had_then() -> None:
    below, rises_first, rises_after = (
        stands(0.0).forecasts(),
        passes(0.0, 5.0, 5.0, 0.0).forecasts(),
        passes(0.0, 0.0, 0.0, 5.0).forecasts(),
    )
    assert nearest_approach(rises_first, below, CLEARANCE_M, 0.0, 59.0) is None
    meeting = nearest_approach(rises_after, below, CLEARANCE_M, 0.0, 59.0)
    assert meeting
    assert meeting.began_s == pytest.approx(28.7, abs=0.01)


def test_a_robot_does_not_meet_itself_where_it_changes_its_height() -> None:
    rising, far = (
        track(*((float(t), 0.0, 0.0, 0.3 * t) for t in range(20))),
        track((0.0, 50.0, 0.0, 0.0), (19.0, 50.0, 0.0, 0.0)),
    )
    assert len(rising.forecasts()) == 20
    assert nearest_approach(rising.forecasts(), far.forecasts(), CLEARANCE_M, 0.0, 19.0) is None


def test_heights_that_hardly_change_or_are_unknown_count_as_one() -> None:
    shaking = track(*((float(t), 0.0, 0.0, 0.04 * (t % 2)) for t in range(20)))
    assert len(shaking.forecasts()) == 1
    assert (shaking.forecasts().bottom_m[0], shaking.forecasts().top_m[0]) == (0.0, pytest.approx(1.04))
    unknown = RecordedTrack(
        "A", "acme", [ReportedPose(float(t), 0.0, 0.0, 0.0, 0, -inf, inf) for t in range(3)], 1.0, 1.0
    )
    assert len(unknown.forecasts()) == 1
    assert nearest_approach(unknown.forecasts(), stands(9.0).forecasts(), 6.0, 0.0, 2.0)


def test_a_robot_that_changes_floor_and_height_stands_until_then() -> None:
    lifted = track((0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (2.0, 40.0, 40.0, 5.0), floors=(0, 0, 1)).forecasts()
    assert lifted.t_s[lifted.start[0] : lifted.start[1]].tolist() == [0.0, 1.0, 2.0]
    assert (row_at(lifted, 1.9), row_at(lifted, 2.0), row_at(lifted, -5.0)) == (0, 1, 0)
