"""Which pairs are examined if there are too many: what is never left out, and who pays."""

from collections.abc import Iterable
from math import cos, pi, sin

import numpy as np
import pytest

from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.pair_choice import (
    ALWAYS,
    ALWAYS_WATCHED,
    BOXES,
    FASTEST_M,
    LATER_S,
    MOST_OF_SOURCE,
    PairNeeds,
    Sharers,
    _went_m,
    chosen_pairs,
)
from ingest.batch import Bools, Floats, Forecasts, Ints
from tests.helpers.made_encounters import NOW_S, robot

ATTACKERS, HONEST = 300, 40
SLOTS = HONEST + ATTACKERS
MOST = 1200
BODIES = 100


def all_pairs() -> tuple[Ints, Ints]:
    """All pairs of attackers, each of them with each honest robot, and each honest robot with the next three."""
    a, b = np.triu_indices(SLOTS, 1)
    is_honest = b < HONEST
    kept = ~is_honest | (b - a <= 3)
    return a[kept].astype(np.int64), b[kept].astype(np.int64)


def needs(a: Ints, b: Ints, moment: Ints | None = None, is_watched: Bools | None = None) -> PairNeeds:
    gap_m: Floats = np.abs(a - b) * 0.1
    at_once, unwatched = np.zeros_like(a), np.zeros(len(a), bool)
    return PairNeeds(
        a, b, at_once if moment is None else moment, gap_m, unwatched if is_watched is None else is_watched, at_once + 1
    )


def sharers(sources: int = 2, *, is_new: bool = False, is_crowded: bool = False, later_s: float = 0.0) -> Sharers:
    """Honest robots of source 0; attackers of source 0 too, or of the others."""
    is_attacker = np.arange(SLOTS) >= HONEST
    source = np.where(is_attacker, np.arange(SLOTS) % max(sources - 1, 1) + (sources > 1), 0)
    return Sharers(
        source,
        np.where(is_attacker, later_s, 0.0),
        is_attacker & is_new,
        is_attacker & is_crowded,
        np.zeros(SLOTS, bool),
    )


def honest(a: Ints, b: Ints) -> Bools:
    return (a < HONEST) & (b < HONEST)


@pytest.mark.parametrize("sources", [2, 9, 64])
def test_a_source_with_few_pairs_gets_them_all_however_many_others_ask_for(sources: int) -> None:
    a, b = all_pairs()
    moment = np.where(honest(a, b), 9, 0)  # theirs come latest of all
    chosen = chosen_pairs(needs(a, b, moment), sharers(sources, is_new=sources > 9), MOST)
    assert chosen[honest(a, b)].all()
    assert chosen.sum() < MOST + ALWAYS * SLOTS


def test_within_one_source_robots_that_were_there_come_before_newcomers() -> None:
    a, b = all_pairs()
    moment = np.where(honest(a, b), 9, 0)
    chosen = chosen_pairs(needs(a, b, moment), sharers(1, is_new=True), MOST)
    assert chosen[honest(a, b)].all()
    assert chosen.sum() < MOST + ALWAYS * SLOTS


def test_within_one_source_robots_that_were_there_come_first_also_once_nobody_is_new() -> None:
    a, b = all_pairs()
    moment = np.where(honest(a, b), 9, 0)
    chosen = chosen_pairs(needs(a, b, moment), sharers(1, later_s=2 * LATER_S), MOST)
    assert chosen[honest(a, b)].all()
    assert chosen.sum() < MOST + ALWAYS * SLOTS


@pytest.mark.parametrize("sources", [64, 150])
def test_who_came_later_pays_for_pairs_with_robots_that_were_there(sources: int) -> None:
    a, b = all_pairs()
    moment = np.where(honest(a, b), 9, 0)
    assert chosen_pairs(needs(a, b, moment), sharers(sources, later_s=2 * LATER_S), MOST)[honest(a, b)].all()
    assert not chosen_pairs(needs(a, b, moment), sharers(sources), MOST)[honest(a, b)].all()


def test_a_watched_pair_is_never_left_out_for_a_new_one() -> None:
    a, b = all_pairs()
    is_watched = b - a == 1
    assert ALWAYS_WATCHED >= 2
    chosen = chosen_pairs(needs(a, b, np.full(len(a), 9), is_watched), sharers(1), 10)
    assert chosen[is_watched].all()


def test_of_many_watched_pairs_of_a_robot_the_first_stay_and_more_as_the_budget_has() -> None:
    a, b = all_pairs()
    is_watched = np.random.default_rng(1).random(len(a)) < 0.03
    moments = np.random.default_rng(2).integers(0, 10, len(a))
    few = chosen_pairs(needs(a, b, moments, is_watched), sharers(1), 10)
    of_robot = np.bincount(np.concatenate([side[is_watched & few] for side in (a, b)]), minlength=SLOTS)
    left_out = is_watched & ~few
    assert left_out.any()
    assert (of_robot[a[left_out]] >= ALWAYS_WATCHED).all()
    assert (of_robot[b[left_out]] >= ALWAYS_WATCHED).all()
    all_watched = chosen_pairs(needs(a, b, moments, is_watched), sharers(1), int(is_watched.sum()) + SLOTS * ALWAYS)
    assert all_watched[is_watched].all()


def test_a_robot_has_no_more_pairs_in_any_case_by_the_order_of_names() -> None:
    a, b = all_pairs()
    of_one = (a == SLOTS // 2) | (b == SLOTS // 2)
    others = np.where(np.arange(SLOTS) == SLOTS // 2, False, True)
    chosen = chosen_pairs(needs(a[of_one], b[of_one]), sharers(1)._replace(is_crowded=others), 0)
    assert chosen.sum() == ALWAYS


def test_the_most_urgent_pairs_of_a_robot_are_chosen_first() -> None:
    others = np.arange(HONEST, SLOTS)
    a, moment = np.zeros(len(others), np.int64), others[::-1] % 10
    chosen = chosen_pairs(needs(a, others, moment), sharers(1, is_crowded=True), MOST_OF_SOURCE)
    assert chosen.sum() == MOST_OF_SOURCE
    assert moment[chosen].max() <= moment[~chosen].min()


def test_what_crowded_robots_need_does_not_count() -> None:
    a, b = all_pairs()
    with_crowd = ~honest(a, b) & (a < HONEST)
    chosen = chosen_pairs(needs(a[with_crowd], b[with_crowd]), sharers(2, is_crowded=True), 1)
    of_honest = np.bincount(a[with_crowd][chosen], minlength=HONEST)
    assert of_honest.max() <= ALWAYS + 1


def test_the_order_of_the_pairs_decides_nothing() -> None:
    a, b = all_pairs()
    order = np.random.default_rng(2).permutation(len(a))
    chosen = chosen_pairs(needs(a, b), sharers(3), MOST)
    again = chosen_pairs(needs(a[order], b[order]), sharers(3), MOST)
    assert abs(int(chosen.sum()) - int(again.sum())) <= SLOTS  # equal gaps may be told apart by their order
    assert (chosen & honest(a, b))[order].tolist() == (again & honest(a[order], b[order])).tolist()


def test_pairs_cost_what_they_take() -> None:
    others = np.arange(HONEST, SLOTS)
    a, costs = np.zeros(len(others), np.int64), np.full(len(others), 5)
    chosen = chosen_pairs(needs(a, others)._replace(costs=costs), sharers(1, is_crowded=True), 50)
    assert chosen.sum() == 10


def test_a_pass_examines_no_more_than_its_robots_can_have() -> None:
    assert BOXES.of_pass(1, 1000, 0) == BOXES.changed + BOXES.spare
    assert BOXES.of_pass(100, 1000, 0) == BOXES.changed * 100 + BOXES.spare
    assert BOXES.of_pass(100, 1000, int(BOXES.held * 1000)) == BOXES.least * 100
    room = BOXES.least * 500 + 1
    assert BOXES.of_pass(500, 1000, int(BOXES.held * 1000) - room) == room
    assert BOXES.of_pass(10, 20, BOXES.held_least - 100) == 100


def test_a_robot_that_is_served_gets_none_of_its_pairs_whatever_the_budget() -> None:
    others = np.arange(HONEST, HONEST + 10)
    a, equal = np.zeros_like(others), sharers(1)
    assert chosen_pairs(needs(a, others), equal, 0).all()  # each of the others has its most urgent one
    served = equal._replace(is_served=np.ones(SLOTS, bool))
    assert not chosen_pairs(needs(a, others), served, 0).any()
    assert chosen_pairs(needs(a, others), served, len(others)).all()


class EqualClaims:
    """All robots are of one source and came together; none is watched."""

    def sources(self) -> tuple[Ints, Floats, Bools]:
        return np.zeros(BODIES, np.int64), np.zeros(BODIES), np.zeros(BODIES, bool)

    def watched(self) -> Iterable[tuple[str, str]]:
        return ()

    def partly_examined(self) -> list[str]:
        return []


@pytest.mark.parametrize("crowded", [True, False])
def test_a_robot_that_reports_seldom_keeps_its_conflicts_while_the_budget_binds(crowded: bool) -> None:
    """Others drive at it, and a heap elsewhere takes all of the budget in each pass."""
    coming = {f"coming {number}": number * pi / 6 for number in range(12)}
    sweeper = Sweeper(clearance_m=0.3, crowds=dict.fromkeys(coming, 1) if crowded else {}, claims=EqualClaims())
    sweeper.update(["stands"], robot((0.0, 60.0), (0.0, 0.0), (0.0, 0.0), 0.0, (1.0, 0.6)))
    for second in range(5):
        rows, seconds = dict[str, Forecasts](), (float(second), second + 10.0)
        for name, from_rad in coming.items():
            away_m = np.array([9.0 - second, -1.0 - second])
            rows[name] = robot(seconds, away_m * cos(from_rad), away_m * sin(from_rad), from_rad, (0.4, 0.4))
        for number in range(60):
            place = [50.0 + number * 1e-3] * 2
            rows[f"heap {number}"] = robot(seconds, place, place, 0.0, (1.0, 0.6))
        sweeper.update(list(rows), Forecasts.joined(rows.values()))
        found = sweeper.find_conflicts(NOW_S + second)
        assert found.left_out > 0
        assert sum("stands" in pair for pair in found.pairs) >= ALWAYS


@pytest.mark.parametrize(("speed_mps", "is_left_out"), [(30.0, True), (0.5, False)])
def test_bodies_that_are_faster_than_robots_cost_more_than_their_boxes(speed_mps: float, *, is_left_out: bool) -> None:
    """Each of the one half crosses the way of each of the other half, in one box."""
    sweeper, rows, ahead_m = Sweeper(clearance_m=0.3, claims=EqualClaims()), dict[str, Forecasts](), 10 * speed_mps
    for number in range(30):
        beside_m = 1.0 * number
        rows[f"east {number}"] = robot((0.0, 10.0), (0.0, ahead_m), (beside_m, beside_m), 0.0, (0.2, 0.2))
        rows[f"north {number}"] = robot((0.0, 10.0), (beside_m, beside_m), (0.0, ahead_m), pi / 2, (0.2, 0.2))
    sweeper.update(list(rows), Forecasts.joined(rows.values()))
    assert (sweeper.find_conflicts(NOW_S).left_out > 0) == is_left_out


@pytest.mark.parametrize(("floors", "is_last"), [((0, 0), True), ((0, 1), False)])
def test_a_robot_is_not_fast_for_the_coordinates_of_the_floor_that_it_goes_to(
    floors: tuple[int, int], is_last: bool
) -> None:
    sweeper = Sweeper(clearance_m=0.3)
    sweeper.update(["lift"], robot((0.0, 1.0), (0.0, 80.0), (0.0, 0.0), 0.0, (1.0, 0.6), floor=floors))
    sweeper.find_conflicts(NOW_S)
    box = sweeper._boxes.by_ring[:, :1]
    went_m = _went_m(box[box["slab"] == int(NOW_S)], np.array([0.8]))
    assert (went_m > FASTEST_M).tolist() == [is_last]
