"""Which robot gave way to which: one small case for each kind of interaction."""

import numpy as np
import pytest

from deconflict.foresight.interactions import interaction_finder
from deconflict.foresight.interactions.interaction_finder import InteractionOutcome
from deconflict.sweep.geometry.heights import heights_overlap
from ingest.batch import Bools, Floats
from tests.deconflict.foresight.interactions.made_reports import NOW_S, Robot, blind, drives, found, stops


def test_robots_that_brake_head_on_give_way() -> None:
    # 20 m apart at 1 m/s each; both stop 0.6 m apart after 9.2 s
    pair = [blind(stops(0.0, 1.0, 9.2), 1.0), blind(stops(20.0, -1.0, 9.2), -1.0, vendor=1)]
    first = found(pair, 14.0)[0]
    assert (first.outcome, {first.robot, first.other}, first.swerved) == (InteractionOutcome.YIELDED, {0, 1}, False)
    assert first.onset_s - NOW_S == pytest.approx(9.2, abs=1.0)


def test_robots_that_pass_with_room_do_not_give_way() -> None:
    assert found([Robot(drives(0.0, 1.0)), Robot(drives(20.0, -1.0, y_m=1.4), vendor=1)], 20.0) == []


def test_a_robot_that_stalls_alone_gives_way_to_nobody() -> None:
    assert found([blind(stops(0.0, 1.0, 9.0), 1.0), Robot(drives(-40.0, 1.0, y_m=6.0), vendor=1)], 16.0) == []


def test_a_robot_beside_the_way_is_not_in_it() -> None:
    beside = Robot(drives(9.6, 0.0, y_m=0.75), vendor=1)
    assert found([blind(stops(0.0, 1.0, 9.2), 1.0), beside], 16.0) == []


def test_a_robot_that_rests_is_still_in_the_way_and_one_that_rests_itself_gives_way_no_longer() -> None:
    robots = [blind(stops(0.0, 1.0, 9.2), 1.0), Robot(drives(10.7, 0.0), vendor=1)]
    assert found(robots, 16.0)
    assert found(robots, 16.0, rests_s={1: 2.0}) == found(robots, 16.0)
    *before, last = found(robots, 16.0, rests_s={0: 12.0})
    assert before == found(robots, 12.0)
    assert last == before[-1]._replace(end_s=NOW_S + 11.0)


def test_a_planned_stop_is_no_interaction() -> None:
    does = stops(0.0, 1.0, 9.2)
    assert found([Robot(does), Robot(drives(10.7, 0.0), vendor=1)], 16.0) == []


def test_an_explained_stop_is_no_interaction() -> None:
    robots = [blind(stops(0.0, 1.0, 9.2), 1.0), Robot(drives(10.7, 0.0), vendor=1)]
    assert found(robots, 16.0, explained=[0]) == []
    assert found(robots, 16.0)


def test_robots_that_stop_far_from_each_other_are_compared_with_few(monkeypatch: pytest.MonkeyPatch) -> None:
    compared = list[int]()

    def counted(bottom_m: Floats, *levels_m: Floats) -> Bools:
        compared.append(len(bottom_m))
        overlap: Bools = heights_overlap(bottom_m, *levels_m)
        return overlap

    monkeypatch.setattr(interaction_finder, "heights_overlap", counted)
    pairs = [
        (blind(stops(0.0, 1.0, 9.2, y_m=y_m), 1.0), Robot(drives(10.7, 0.0, y_m=y_m), vendor=1))
        for y_m in (100.0 * np.arange(12)).tolist()
    ]
    interactions = found([robot for pair in pairs for robot in pair], 16.0)
    assert len({interaction.robot for interaction in interactions}) == len(pairs)
    assert max(compared) <= 2


def test_a_robot_above_is_not_in_the_way() -> None:
    robots = [blind(stops(0.0, 1.0, 9.2), 1.0), Robot(drives(10.7, 0.0), vendor=1)]
    assert found(robots, 16.0, levels_m=np.array([[0.0, 5.0], [1.0, 6.0]])) == []


@pytest.mark.parametrize(
    ("clears", "outcome"), [(True, InteractionOutcome.ORDERED), (False, InteractionOutcome.YIELDED)]
)
def test_a_robot_that_drives_on_after_one_of_its_vendor_has_cleared_followed_an_order(
    clears: bool, outcome: InteractionOutcome
) -> None:
    # the other crosses in front at 9 s and is away by 14 s, or it stays
    crosses = lambda t_s: (10.6, -9.0 + 1.0 * t_s if clears or t_s < 9.0 else 0.0, np.pi / 2)  # noqa: E731
    waits = stops(0.0, 1.0, 9.2, until_s=14.0)
    goes = blind(waits, 1.0)
    last = found([goes, Robot(crosses)], 18.0)[-1]
    assert (last.robot, last.other, last.outcome) == (0, 1, outcome)
    assert last.end_s - NOW_S == pytest.approx(15.0, abs=1.1)


def test_the_kind_is_unknown_within_one_vendor_until_the_robot_drives_on() -> None:
    pair = [blind(stops(0.0, 1.0, 9.2), 1.0), blind(stops(20.0, -1.0, 9.2), -1.0)]
    assert {interaction.outcome for interaction in found(pair, 20.0)} == {InteractionOutcome.UNKNOWN}


def test_a_robot_that_swings_out_around_another_has_given_way() -> None:
    def swings(t_s: float) -> tuple[float, float, float]:
        aside_m = 0.9 if 9.0 <= t_s <= 12.0 else 0.45 if 8.0 <= t_s < 9.0 else 0.0
        return t_s, aside_m, 0.0

    swerving = Robot(swings, lambda _: drives(0.0, 1.0))
    (first, *_) = found([swerving, Robot(drives(10.0, 0.0), vendor=1)], 16.0)
    assert (first.outcome, first.swerved) == (InteractionOutcome.YIELDED, True)
    assert found([swerving, Robot(drives(10.0, 0.0), vendor=1)], 16.0, usual_m=1.0) == []


@pytest.mark.parametrize("every_s", [0.5, 1.0, 5.0])
def test_robots_that_report_seldom_are_found_too_and_say_how_sure_the_onset_is(every_s: float) -> None:
    pair = [blind(stops(0.0, 1.0, 19.2), 1.0), blind(stops(40.0, -1.0, 19.2), -1.0, vendor=1)]
    first = found(pair, 32.0, every_s)[0]
    assert first.outcome is InteractionOutcome.YIELDED
    assert abs(first.onset_s - NOW_S - 19.2) <= max(first.doubt_s, 1.0)
    assert (first.doubt_s > 2.0) == (every_s > 2.1)


def test_an_interaction_that_continues_is_not_a_new_one() -> None:
    # it stands for four seconds, creeps on for two, and stands again
    def waits(t_s: float) -> tuple[float, float, float]:
        return min(t_s, 9.2) + max(min(t_s, 15.0) - 13.0, 0.0) * 0.5, 0.0, 0.0

    interactions = found([blind(waits, 1.0), Robot(drives(11.5, 0.0), vendor=1)], 24.0)
    assert sum(not interaction.again and interaction.end_s == np.inf for interaction in interactions) <= 1


def test_with_the_other_robots_track_shifted_by_a_minute_nothing_is_found() -> None:
    cleared = Robot(lambda t_s: drives(20.0, -1.0)(t_s + 60.0), vendor=1)
    assert found([blind(stops(0.0, 1.0, 9.2), 1.0), cleared], 16.0) == []
