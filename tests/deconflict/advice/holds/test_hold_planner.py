"""Holds that clear a group of conflicts: swept again they do, and nothing that can be tried is cheaper."""

from dataclasses import replace
from functools import partial
from itertools import combinations, product
from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from deconflict.advice.conflict_advice import advise_conflicts
from deconflict.advice.holds.hold_windows import SHORTEST_HOLD_S, STEP_S, DelayWindows, HoldWindow
from deconflict.settings.site import Advice
from deconflict_client.advisory import Hold, Recommendation
from ingest.batch import Pair
from tests.deconflict.advice.made_near import SeenRobot, group_plan, near
from tests.helpers.made_encounters import NOW_S, robot

WINDOW = HoldWindow(NOW_S, 10.0, 0.3, 6.0)
B_WAITS = Hold(robot="b", hold_s=2.0)


def through(
    name: str,
    yaw_rad: float,
    *,
    before_m: float = 5.0,
    speed_mps: float = 1.0,
    vendor: str = "acme",
    priority: float = 1.0,
) -> SeenRobot:
    """Goes straight through the origin."""
    reach_m = 10 * speed_mps - before_m
    along = [-before_m, reach_m]
    x, y = [m * cos(yaw_rad) for m in along], [m * sin(yaw_rad) for m in along]
    return SeenRobot(name, robot([0, 10], x, y, yaw_rad, (1.0, 0.6)), vendor, priority=priority)


def standing(name: str, x_m: float, y_m: float = 0.0) -> SeenRobot:
    return SeenRobot(name, robot([0], [x_m], [y_m], 0.0, (1.0, 0.6)), holdable=False)


def pairs_of(movers: list[SeenRobot]) -> list[Pair]:
    return [(a.robot, b.robot) for a, b in combinations(movers, 2)]


def held_s(advice: Recommendation) -> dict[str, float]:
    return {hold.robot: hold.hold_s for hold in advice.holds}


def met(robots: list[SeenRobot], window: HoldWindow, held_s: dict[str, float]) -> dict[Pair, float]:
    return DelayWindows(near(robots), window).contacts_s(held_s, [robot.robot for robot in robots])


def cheapest_s(movers: list[SeenRobot], window: HoldWindow) -> float | None:
    """The least weighted waiting over every choice of holds, each swept as it is; None where none is clear."""

    def cost(holds: tuple[float, ...]) -> float:
        return sum(seen_robot.priority * hold_s for seen_robot, hold_s in zip(movers, holds, strict=True))

    grid = [0.0] + [k * STEP_S for k in range(window.steps + 1) if k * STEP_S >= SHORTEST_HOLD_S]
    choices = sorted(product(*(grid if mover.holdable else [0.0] for mover in movers)), key=cost)
    delays, names = DelayWindows(near(movers), window), [mover.robot for mover in movers]
    return next(
        (cost(holds) for holds in choices if not delays.contacts_s(dict(zip(names, holds, strict=True)), names)),
        None,
    )


@settings(max_examples=12, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-pi, pi), st.floats(2.5, 6.0), st.floats(0.5, 1.5), st.sampled_from([0.5, 1.0, 10.0])),
        min_size=2,
        max_size=3,
    )
)
def test_holds_resolve_the_conflicts_at_the_least_cost(courses: list[tuple[float, float, float, float]]) -> None:
    window = HoldWindow(NOW_S, 10.0, 0.3, 4.0)
    movers = [
        through(str(row), yaw, before_m=m, speed_mps=v, priority=weight)
        for row, (yaw, m, v, weight) in enumerate(courses)
    ]
    found = met(movers, window, {})
    assume(found)
    apart = all(
        min(abs(a.forecast.x_m[0] - b.forecast.x_m[0]), 9.0) + abs(a.forecast.y_m[0] - b.forecast.y_m[0]) > 2.0
        for a, b in combinations(movers, 2)
    )
    assume(apart)
    advice = group_plan(near(movers), pairs_of(movers), window)
    assert advice == group_plan(near(movers), pairs_of(movers), window)
    cheapest = cheapest_s(movers, window)
    if cheapest is None:
        assert advice.note
        return
    assert advice.cost_s == cheapest
    assert advice.proven_optimal
    assert met(movers, window, held_s(advice)) == {}
    assert advice.first_come_cost_s is None or advice.cost_s <= advice.first_come_cost_s


def test_the_bound_of_standing_advice_is_the_cost_of_the_cheapest_plan() -> None:
    pair = [through("a", 0.0, before_m=5.3), through("b", pi / 2)]
    fresh = group_plan(near(pair), [("a", "b")], WINDOW)
    kept = group_plan(near(pair), [("a", "b")], WINDOW, standing=fresh.model_copy(update={"holds": (B_WAITS,)}))
    assert kept.holds == (Hold(robot="b", hold_s=2.5),)
    assert (kept.bound_s, kept.proven_optimal) == (fresh.cost_s, False)
    same = group_plan(near(pair), [("a", "b")], WINDOW, standing=fresh)
    assert (same.holds, same.bound_s, same.proven_optimal) == (fresh.holds, fresh.cost_s, True)


def test_allowed_differences_are_those_at_which_the_sweep_finds_no_contact() -> None:
    a, b = through("a", 0.0), through("b", 1.2, before_m=4.0)
    (allowed,) = DelayWindows(near([a, b]), WINDOW).allowed([("a", "b")])
    swept = [
        step
        for step in range(-WINDOW.steps, WINDOW.steps + 1)
        if not met([a, b], WINDOW, {"a": max(step, 0) * STEP_S, "b": max(-step, 0) * STEP_S})
    ]
    assert (np.flatnonzero(allowed) - WINDOW.steps).tolist() == swept
    assert 0 < len(swept) < 2 * WINDOW.steps + 1


def test_a_held_robot_that_stands_in_the_way_is_no_help() -> None:
    ahead, behind = through("ahead", 0.0, before_m=2.0, speed_mps=0.5), through("behind", 0.0, before_m=5.5)
    advice = group_plan(near([ahead, behind]), [("ahead", "behind")], WINDOW)
    assert {hold.robot for hold in advice.holds} == {"behind"}


def test_head_on_in_one_lane_needs_another_route() -> None:
    pair = ("east", "west")
    advice = advise_conflicts(near([through("east", 0.0), through("west", pi, priority=0.5)]), [pair], WINDOW)[pair]
    assert advice.holds == ()
    assert advice.note == "no hold keeps east and west apart: west should take another route"


def test_a_robot_that_stands_is_not_told_to_wait() -> None:
    pair = ("a", "parked")
    advice = advise_conflicts(near([standing("parked", 0.0), through("a", 0.0)]), [pair], WINDOW)[pair]
    assert advice.holds == ()
    assert advice.note == "no hold keeps a and parked apart: a should take another route"


def test_no_hold_brings_another_pair_together() -> None:
    """C comes up close behind A and would meet it if A waited: of two equal holds B's is the one that works."""
    a, b = through("a", 0.0, vendor="bolt"), through("b", pi / 2)
    tail = SeenRobot("c", robot([0, 10], [-7.0, 3.0], [0.0, 0.0], 0.0, (1.0, 0.6)), holdable=False)
    burdens_s = {"acme": 60.0}
    alone = group_plan(near([a, b]), [("a", "b")], WINDOW, burdens_s=burdens_s)
    assert [hold.robot for hold in alone.holds] == ["a"]
    movers = [a, b, tail]
    advice = group_plan(near(movers), [("a", "b")], WINDOW, burdens_s=burdens_s)
    assert [hold.robot for hold in advice.holds] == ["b"]
    before = met(movers, WINDOW, {})
    assert set(met(movers, WINDOW, held_s(advice))) <= set(before) - {("a", "b")}


@pytest.mark.parametrize(("burdened", "yields"), [("acme", "b"), ("bolt", "a")])
def test_in_a_tie_the_least_burdened_vendor_waits(burdened: str, yields: str) -> None:
    pair = [through("a", 0.0, vendor="acme"), through("b", pi / 2, vendor="bolt")]
    advice = group_plan(near(pair), [("a", "b")], WINDOW, burdens_s={burdened: 60.0})
    assert [hold.robot for hold in advice.holds] == [yields]


def test_another_robot_is_held_only_if_that_saves_enough() -> None:
    pair = [through("a", 0.0, before_m=5.3, vendor="bolt"), through("b", pi / 2)]
    question = partial(group_plan, near(pair), [("a", "b")], WINDOW, burdens_s={"bolt": 60.0})
    fresh = question()
    assert fresh.holds == (Hold(robot="a", hold_s=2.0),)
    before = fresh.model_copy(update={"holds": (B_WAITS,)})
    assert question(standing=before).holds == (Hold(robot="b", hold_s=2.5),)
    assert question(standing=before, settings=Advice(switch_s=0.25)).holds == fresh.holds


def test_a_ring_without_a_plan_is_named_although_each_of_its_pairs_has_one() -> None:
    """Each two of a, b and c keep apart if one waits 2 s; three would need 4 s, and nobody may wait longer than 3 s.

    d only meets a, which both waiting d and waiting a would clear.
    """
    window = replace(WINDOW, longest_hold_s=3.0)
    ring = [through(name, row * 2 * pi / 3, vendor="acme" if name == "b" else "bolt") for row, name in enumerate("abc")]
    for two in combinations(ring, 2):
        alone = group_plan(near(list(two)), pairs_of(list(two)), window)
        assert alone.holds, f"{two[0].robot} and {two[1].robot} alone"
    other = SeenRobot("d", robot([0, 10], [-4.0, -4.0], [-6.0, 4.0], pi / 2, (1.0, 0.6)))
    movers = [*ring, other]
    assert cheapest_s(movers, window) is None
    met = [pair for pair in pairs_of(movers) if set(pair) <= set("abc") or pair == ("a", "d")]
    advice = advise_conflicts(near(movers), met, window, burdens_s={"acme": 0.0, "bolt": 9.0})
    assert {pair: advice[pair].note for pair in met} == {
        ("a", "b"): "no hold works for a, b and c: b should take another route",
        ("a", "c"): "",
        ("a", "d"): "",
        ("b", "c"): "no hold works for a, b and c: b should take another route",
    }
    assert advice["a", "c"].holds, "without b the others have a plan"


def test_four_ways_at_one_crossing() -> None:
    movers = [through(name, row * pi / 4, before_m=5.0) for row, name in enumerate("abcd")]
    advice = group_plan(near(movers), pairs_of(movers), WINDOW)
    assert advice.proven_optimal
    assert met(movers, WINDOW, held_s(advice)) == {}
    assert advice.first_come_cost_s is not None
    assert advice.cost_s <= advice.first_come_cost_s
