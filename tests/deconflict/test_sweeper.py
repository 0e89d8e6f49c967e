"""A floor that is swept step by step gives at each step what a fresh sweep of the same floor gives."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import Generator

from deconflict import sweeper as module
from deconflict.broadphase import FEW
from deconflict.sweeper import PairConflicts, Sweeper
from ingest.seam import Forecasts
from tests.deconflict.made_encounters import NOW_S, robot, wanderer

CLEARANCE_M = 0.25
COLUMNS = ("contact_s", "separation_m", "separation_at_s", "start_separation_m")


class Floor:
    """What has been told so far, and a sweeper that was told it bit by bit."""

    def __init__(self, clearance_m: float = CLEARANCE_M) -> None:
        self.clearance_m = clearance_m
        self.told: dict[str, Forecasts] = {}
        self.sweeper = Sweeper(clearance_m=clearance_m)

    def tell(self, **forecasts: Forecasts) -> None:
        self.told |= forecasts
        self.sweeper.update(list(forecasts), Forecasts.joined(forecasts.values()))

    def leave(self, *keys: str) -> None:
        for key in keys:
            self.told.pop(key, None)
        self.sweeper.discard(keys)

    def step(self, now_s: float) -> PairConflicts:
        """What the sweeper says, held against one that is told everything at once in another order."""
        found = self.sweeper.step(now_s)
        fresh = Sweeper(clearance_m=self.clearance_m)
        for key in sorted(self.told, reverse=True):
            fresh.update([key], self.told[key])
        expected = fresh.step(now_s)
        assert found.pairs == expected.pairs
        for column in COLUMNS:
            np.testing.assert_array_equal(getattr(found, column), getattr(expected, column), err_msg=column)
        return found


def later(rng: Generator, at_s: float) -> Forecasts:
    """A robot that reports at `at_s` after `NOW_S`; some are on the second floor, some are low, some grow."""
    made = wanderer(rng, spread_m=8.0)
    growth = rng.choice([0.0, 0.4])
    return replace(
        made,
        t_s=made.t_s + at_s,
        floor=made.floor + int(rng.random() < 0.2) * (np.arange(len(made.t_s)) > 2),
        length_m=made.length_m + growth,
        width_m=made.width_m + growth,
        top_m=made.top_m * rng.choice([0.2, 1.0]),
        bottom_m=made.bottom_m + rng.choice([0.0, 0.3]) * (made.top_m > 0.5),
    )


def lived(seed: int, robots: int, steps: int, share: float) -> list[PairConflicts]:
    """Robots that report, join, leave and stay silent, for `steps` of up to 1.3 s and one of a minute."""
    rng = np.random.default_rng(seed)
    floor, at_s, found = Floor(), 0.0, []
    floor.tell(**{f"r{n}": later(rng, 0.0) for n in range(robots)})
    for step in range(steps):
        found.append(floor.step(NOW_S + at_s))
        at_s += 60.0 if step == steps - 3 else float(rng.choice([0.0, 0.1, 0.7, 1.3]))
        chosen = rng.permutation(robots + 3)[: rng.integers(0, int(share * robots) + 2)]
        floor.tell(**{f"r{n}": later(rng, at_s) for n in chosen.tolist()})
        floor.leave(*(f"r{n}" for n in rng.permutation(robots)[: rng.integers(0, 3)].tolist()))
    return found


@pytest.mark.parametrize("share", [0.05, 0.9])
def test_each_step_says_what_a_fresh_sweep_says(share: float) -> None:
    found = lived(seed=1, robots=60, steps=25, share=share)
    assert sum(len(one.pairs) for one in found) > 300
    assert any(one.start_separation_m.max(initial=0) > CLEARANCE_M for one in found)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32), robots=st.integers(2, 30), share=st.floats(0, 1))
def test_each_step_says_so_wherever_hypothesis_looks(seed: int, robots: int, share: float) -> None:
    lived(seed, robots, steps=6, share=share)


def test_nothing_that_did_not_change_is_looked_at_again() -> None:
    floor = Floor()
    rng = np.random.default_rng(5)
    floor.tell(**{f"r{n}": later(rng, 0.0) for n in range(80)})
    whole = floor.step(NOW_S)
    still = floor.step(NOW_S)
    floor.tell(r7=later(rng, 0.0))
    one = floor.step(NOW_S)
    assert whole.box_pairs > 500
    assert still.box_pairs < whole.box_pairs / 8
    assert still.box_pairs < one.box_pairs < whole.box_pairs / 4
    assert whole.fresh.all()
    assert not still.fresh.any()
    assert {pair for pair, fresh in zip(one.pairs, one.fresh, strict=True) if fresh} == {
        pair for pair in one.pairs if "r7" in pair
    }


def test_a_silent_robot_is_only_swept_where_the_horizon_reaches_next() -> None:
    floor = Floor()
    floor.tell(**{f"r{n}": robot([0], [0.7 * n], [0], 0, (0.5, 0.5)) for n in range(40)})
    whole = floor.step(NOW_S)
    looked_at = [floor.step(NOW_S + second).box_pairs for second in range(1, 9)]
    assert len(whole.pairs) == 39
    assert max(looked_at) < whole.box_pairs * 0.4


def test_a_contact_comes_into_view_begins_and_is_over() -> None:
    floor = Floor()
    floor.tell(
        crosses=robot([0, 40], [-20, 20], [0, 0], 0, (1, 1)), stands=robot([0], [0], [0], 0, (1, 1), height=(0.2, 0.5))
    )
    contact_s = NOW_S + 20 - 1.25
    assert not floor.step(contact_s - 10.01).pairs
    seen = floor.step(contact_s - 9.99)
    assert seen.pairs == (("crosses", "stands"),)
    assert seen.contact_s[0] == pytest.approx(contact_s, abs=1.5e-3)
    assert seen.start_separation_m[0] == pytest.approx(10.24, abs=1e-3)
    inside = floor.step(NOW_S + 20.0)
    assert inside.contact_s[0] == NOW_S + 20.0
    assert inside.start_separation_m[0] == inside.separation_m[0] == 0
    drawing_apart = floor.step(NOW_S + 21.1)
    assert drawing_apart.separation_m[0] == pytest.approx(0.1, abs=1e-3)
    assert not floor.step(NOW_S + 21.3).pairs


def test_a_robot_whose_new_forecast_is_invalid_is_off_the_floor_until_its_next() -> None:
    floor = Floor()
    here = {key: robot([0], [0], [0], 0, (1, 1)) for key in ("a", "b")}
    floor.tell(**here)
    assert floor.step(NOW_S).pairs == (("a", "b"),)
    nowhere = replace(here["b"], x_m=np.array([np.nan]))
    assert floor.sweeper.update(["b"], nowhere) == (("b", "not-finite"),)
    floor.told.pop("b")
    assert not floor.step(NOW_S).pairs
    floor.tell(b=here["b"])
    assert floor.step(NOW_S).pairs == (("a", "b"),)


def test_of_a_robot_told_twice_at_once_the_later_counts() -> None:
    sweeper = Sweeper(clearance_m=CLEARANCE_M)
    here, away = robot([0], [0], [0], 0, (1, 1)), robot([0], [9], [0], 0, (1, 1))
    sweeper.update(["a", "b", "b"], Forecasts.joined([here, here, away]))
    assert not sweeper.step(NOW_S).pairs
    sweeper.update(["b", "b"], Forecasts.joined([away, here]))
    assert sweeper.step(NOW_S).pairs == (("a", "b"),)


def test_time_may_go_back() -> None:
    floor = Floor()
    rng = np.random.default_rng(2)
    floor.tell(**{f"r{n}": later(rng, 0.0) for n in range(20)})
    for at_s in (0.0, 30.0, 2.0, 0.5):
        floor.step(NOW_S + at_s)


def test_many_robots_at_once_are_swept_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    crowd = {f"r{n}": later(rng, 0.0) for n in range(60)}
    floor = Floor()
    floor.tell(**crowd)
    whole = floor.step(NOW_S)
    monkeypatch.setattr(module, "BLOCK", 37)
    again = Floor()
    again.tell(**crowd)
    assert again.sweeper.step(NOW_S).pairs == whole.pairs


def test_what_is_no_longer_used_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FEWEST_SEGMENTS", 10)
    monkeypatch.setattr("deconflict.roster.FEWEST_KNOTS", 10)
    rng = np.random.default_rng(4)
    floor = Floor()
    sizes = []
    for step in range(30):
        floor.tell(**{f"r{n}": later(rng, step / 10) for n in range(FEW + 3)})
        floor.step(NOW_S + step / 10)
        sizes.append(len(floor.sweeper._pool.all))
    assert max(sizes[10:]) <= max(sizes[:10]) * 2
