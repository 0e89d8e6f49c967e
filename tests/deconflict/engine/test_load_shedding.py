"""What is left out when the engine can't keep up, in which order, and for how long."""

from dataclasses import replace

import numpy as np
import pytest

from deconflict.engine.engine import COARSE_M, Engine
from deconflict.engine.load_shedding import (
    EASY_S,
    LATE_PASSES,
    Effort,
    LoadShedder,
)
from deconflict.engine.shared_advisories import REDUCED_LOOK_S
from deconflict.settings.site import Site
from deconflict.sweep.incremental import Sweeper
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from ingest.batch import Forecasts
from tests.deconflict.contention.scenes import resource
from tests.deconflict.contention.scenes import site as floor_with
from tests.deconflict.engine.made_engine import NOW_S, SITE, Floor, eastward, northward

DEADLINE_S = 0.5
LATE, EASY, TIGHT = 0.6, 0.1, 0.4
"""Durations of passes, s."""
EVERY_S = 0.125


def after(*passes_s: float, start: Effort = Effort.FULL) -> list[Effort]:
    """The effort after each pass."""
    shedder, efforts = LoadShedder(DEADLINE_S, start), []
    for number, pass_s in enumerate(passes_s):
        assert shedder.add_pass(pass_s, number * EVERY_S) is (pass_s > DEADLINE_S)
        efforts.append(shedder.effort)
    return efforts


def test_late_passes_in_a_row_leave_out_exact_separations_first_then_far_conflicts() -> None:
    assert after(LATE, EASY, LATE, TIGHT) == [Effort.FULL] * 4
    assert after(*[LATE] * (3 * LATE_PASSES))[LATE_PASSES - 1 :: LATE_PASSES] == [
        Effort.COARSE,
        Effort.NEAR,
        Effort.NEAR,
    ]


def test_no_effort_is_below_the_least() -> None:
    shedder = LoadShedder(DEADLINE_S, least=Effort.COARSE)
    for number in range(3 * LATE_PASSES):
        shedder.add_pass(LATE, number * EVERY_S)
    assert shedder.effort is Effort.COARSE


def test_easy_passes_restore_effort_step_by_step_and_tight_ones_do_not() -> None:
    passes = int(EASY_S / EVERY_S)
    assert after(*[TIGHT] * 500, start=Effort.NEAR)[-1] is Effort.NEAR
    back = after(*[EASY] * (2 * passes + 2), start=Effort.NEAR)
    assert [back[passes - 1], back[passes], back[-1]] == [Effort.NEAR, Effort.COARSE, Effort.FULL]


def test_short_ticks_restore_effort_no_sooner() -> None:
    shedder, passes = LoadShedder(DEADLINE_S, Effort.COARSE), 0
    while shedder.effort is Effort.COARSE:
        shedder.add_pass(EASY, passes / 128)
        passes += 1
    assert (passes - 1) / 128 == EASY_S


def test_effort_that_proved_too_much_is_tried_again_later_each_time() -> None:
    shedder = LoadShedder(DEADLINE_S, Effort.COARSE)
    now_s, waits_s = 0.0, []
    for _ in range(4):
        since_s = now_s
        while shedder.effort is Effort.COARSE:
            shedder.add_pass(EASY, now_s)
            now_s += EVERY_S
        waits_s.append(now_s - EVERY_S - since_s)
        for _ in range(LATE_PASSES):
            shedder.add_pass(LATE, now_s)
    assert waits_s == [EASY_S, 2 * EASY_S, 4 * EASY_S, 8 * EASY_S]


def straight(n: int, random: np.random.Generator) -> Forecasts:
    """Robots that drive on for twenty seconds on a crowded floor."""
    x, y, yaw = random.uniform(0, 40, n), random.uniform(0, 40, n), random.uniform(-3, 3, n)
    t = np.tile([0.0, 20.0], n)
    return Forecasts(
        start=np.arange(n + 1) * 2,
        t_s=t,
        x_m=np.repeat(x, 2) + np.repeat(np.cos(yaw), 2) * t,
        y_m=np.repeat(y, 2) + np.repeat(np.sin(yaw), 2) * t,
        yaw_rad=np.repeat(yaw, 2),
        floor=np.zeros(2 * n, np.int64),
        length_m=np.full(n, 1.2),
        width_m=np.full(n, 0.8),
        bottom_m=np.zeros(n),
        top_m=np.ones(n),
    )


def test_less_effort_misses_no_near_conflict_and_full_effort_finds_all_again() -> None:
    random = np.random.default_rng(3)
    whole, short = (Sweeper(clearance_m=0.3, horizon_s=10.0) for _ in range(2))
    for second in range(8):
        n = 60
        keys, forecasts = [f"r{i:02d}" for i in range(n)], straight(n, random)
        result = list(range(n)) if second == 0 else sorted(random.choice(n, 20, replace=False).tolist())
        for sweeper in (whole, short):
            sweeper.update([keys[row] for row in result], forecasts.take(result))
        now_s, reach_s = second + 0.3, 5.0 if second % 4 else np.inf
        exact, found = whole.find_conflicts(now_s), short.find_conflicts(now_s, reach_s, COARSE_M)
        near = exact.contact_s <= now_s + reach_s
        assert found.pairs == tuple(pair for pair, is_near in zip(exact.pairs, near, strict=True) if is_near)
        assert len(found.pairs) > 10
        np.testing.assert_allclose(found.contact_s, exact.contact_s[near], atol=1e-6)
        over_m = found.separation_m - exact.separation_m[near]
        assert (over_m > -2e-3).all()
        if reach_s == np.inf:
            assert over_m.max() <= COARSE_M + 1e-6


def test_separations_are_coarse_only_at_less_effort() -> None:
    turns = straight(2, np.random.default_rng(5))
    pose = {"x_m": np.zeros(4), "y_m": np.array([0.0, 0.0, 1.9, 1.9]), "yaw_rad": np.array([0.0, 0.0, 0.3, 3.1])}
    turns = replace(turns, **pose, t_s=np.array([0.0, 0.9, 0.0, 0.9]), length_m=np.full(2, 2.0))
    values = []
    for accuracy_m in (1e-3, COARSE_M):
        sweeper = Sweeper(clearance_m=1.5, horizon_s=10.0)
        sweeper.update(["a", "b"], turns)
        values.append(sweeper.find_conflicts(0.0, accuracy_m=accuracy_m).separation_m.item())
    assert values[0] < values[1] <= values[0] + COARSE_M


@pytest.mark.parametrize("effort", Effort)
def test_a_conflict_has_an_advisory_in_time_at_any_effort(effort: Effort) -> None:
    advisories = at_effort(effort)
    assert [advisory.state for advisory in (advisories[0], advisories[-1])] == [
        AdvisoryState.RAISED,
        AdvisoryState.CLEARED,
    ]
    least_s, most_s = (8.0, 10.0) if effort < Effort.NEAR else (SITE.conflict.urgent_s, SITE.conflict.warning_s)
    assert least_s < advisories[0].time_to_conflict_s <= most_s


def at_effort(effort: Effort) -> list[ConflictAdvisory]:
    floor = Floor({"A": eastward(x=-20.0), "B": northward(y=-20.0)}, effort=effort)
    return floor.run(32)


def test_an_open_advisory_on_a_far_conflict_stands_while_far_conflicts_are_left_out() -> None:
    floor = Floor({"A": eastward(x=-20.0), "B": northward(y=-20.0)})
    before = floor.run(12)
    assert before[-1].predicted_at.timestamp() > NOW_S + 12 + SITE.conflict.warning_s
    floor.effort = Effort.NEAR
    assert floor.run(13, from_s=12) == []
    assert {advisory.id for advisory in floor.run(32, from_s=13)} == {before[0].id}


def test_queues_are_looked_at_less_often_at_the_least_effort() -> None:
    def looks(effort: Effort) -> int:
        engine, seen = Engine(floor_with(resource("d1", 0.0, 0.0))), 0
        for tick in range(int(4 * REDUCED_LOOK_S)):
            engine.measures.values.pop("deconflict_deadlocks_ahead", None)
            engine.step(NOW_S + tick, effort)
            seen += "deconflict_deadlocks_ahead" in engine.measures.values
        return seen

    assert (looks(Effort.COARSE), looks(Effort.NEAR)) == (4 * REDUCED_LOOK_S, 4)


def test_the_default_deadline_is_half_a_second() -> None:
    assert Site().engine.deadline_s == DEADLINE_S
