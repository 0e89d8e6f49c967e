"""What robots did by their reports, where they change their height."""

from math import inf

import pytest

from deconflict.foresight.near_misses.near_events import NearEvent, event_at, events
from deconflict.foresight.near_misses.recorded_track import RecordedTrack, ReportedPose
from deconflict.operator.blackbox.hindsight import avoiding_delays_s, row_at
from ingest.batch import Forecasts

CLEARANCE_M = 0.3


def first_event(a: Forecasts, b: Forecasts, clearance_m: float, begin_s: float, end_s: float) -> NearEvent | None:
    return next(events(a, b, clearance_m, begin_s, end_s), None)


def track(*reports: tuple[float, float, float, float], floors: tuple[int, ...] = ()) -> RecordedTrack:
    """A robot of 1 x 1 x 1 m, by time, x, y and bottom."""
    rows = zip(reports, floors or (0,) * len(reports), strict=True)
    known = [ReportedPose(t, x, y, 0.0, floor, bottom, bottom + 1.0, 1.0, 1.0) for (t, x, y, bottom), floor in rows]
    return RecordedTrack("A", "acme", known)


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
    assert (first_event(a, b, CLEARANCE_M, 0.0, 59.0) is not None) is meets
    assert avoiding_delays_s(a, b, CLEARANCE_M, 30.0) == ((None, None) if meets else (0.1, 0.1))


def test_a_robot_meets_others_at_the_height_that_it_had_then() -> None:
    below, rises_first, rises_after = (
        stands(0.0).forecasts(),
        passes(0.0, 5.0, 5.0, 0.0).forecasts(),
        passes(0.0, 0.0, 0.0, 5.0).forecasts(),
    )
    assert first_event(rises_first, below, CLEARANCE_M, 0.0, 59.0) is None
    meeting = first_event(rises_after, below, CLEARANCE_M, 0.0, 59.0)
    assert meeting
    assert meeting.began_s == pytest.approx(28.7, abs=0.01)


def test_a_robot_does_not_meet_itself_where_it_changes_its_height() -> None:
    rising, far = (
        track(*((float(t), 0.0, 0.0, 0.3 * t) for t in range(20))),
        track((0.0, 50.0, 0.0, 0.0), (19.0, 50.0, 0.0, 0.0)),
    )
    assert len(rising.forecasts()) == 20
    assert first_event(rising.forecasts(), far.forecasts(), CLEARANCE_M, 0.0, 19.0) is None


def test_heights_that_hardly_change_or_are_unknown_count_as_one() -> None:
    shaking = track(*((float(t), 0.0, 0.0, 0.04 * (t % 2)) for t in range(20)))
    assert len(shaking.forecasts()) == 1
    assert (shaking.forecasts().bottom_m[0], shaking.forecasts().top_m[0]) == (0.0, pytest.approx(1.04))
    unknown = RecordedTrack(
        "A", "acme", [ReportedPose(float(t), 0.0, 0.0, 0.0, 0, -inf, inf, 1.0, 1.0) for t in range(3)]
    )
    assert len(unknown.forecasts()) == 1
    assert first_event(unknown.forecasts(), stands(9.0).forecasts(), 6.0, 0.0, 2.0)


def test_a_robot_that_changes_floor_and_height_stands_until_then() -> None:
    lifted = track((0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (2.0, 40.0, 40.0, 5.0), floors=(0, 0, 1)).forecasts()
    assert lifted.t_s[lifted.start[0] : lifted.start[1]].tolist() == [0.0, 1.0, 2.0]
    assert (row_at(lifted, 1.9), row_at(lifted, 2.0), row_at(lifted, -5.0)) == (0, 1, 0)


def wavers(*near_s: tuple[float, float]) -> RecordedTrack:
    """It stands 0.2 m beside another within these times, and a metre from it else; it moves in a tenth of a second."""
    ends = [((begin, 2.0), (begin + 0.1, 1.2), (end, 1.2), (end + 0.1, 2.0)) for begin, end in near_s]
    return track((0.0, 5.0, 2.0, 0.0), *((t, 5.0, y, 0.0) for four in ends for t, y in four), (100.0, 5.0, 2.0, 0.0))


def beside(other: RecordedTrack, at_s: float) -> NearEvent | None:
    stood = track((0.0, 5.0, 0.0, 0.0), (100.0, 5.0, 0.0, 0.0))
    return event_at(stood.forecasts(), other.forecasts(), CLEARANCE_M, at_s, 100.0)


def test_an_event_is_the_same_from_whichever_moment_one_looks() -> None:
    seen = {beside(wavers((40.3, 41.0), (43.5, 46.7)), at_s) for at_s in (35.0, 40.5, 42.0, 45.1, 49.0)}
    (event,) = seen
    assert event
    assert event.began_s == pytest.approx(40.39, abs=0.01)
    assert event.ended_s == 47.0
    assert event.separation_m == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(("again_s", "count"), [(43.9, 1), (44.9, 1), (45.0, 2)])
def test_a_pair_that_keeps_apart_for_three_whole_seconds_has_met_again(again_s: float, count: int) -> None:
    stood, other = track((0.0, 5.0, 0.0, 0.0), (100.0, 5.0, 0.0, 0.0)), wavers((40.3, 41.2), (again_s, 46.7))
    assert len(list(events(stood.forecasts(), other.forecasts(), CLEARANCE_M, 0.0, 100.0))) == count
