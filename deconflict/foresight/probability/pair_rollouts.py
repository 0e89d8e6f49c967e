"""Driving robots on together: who takes part at a look, and what it says of the watched pairs."""

import numpy as np

from deconflict.foresight.forecast_errors.pending_forecasts import PendingForecasts
from deconflict.foresight.probability.pair_table import (
    DRIVEN,
    Pairs,
    codes,
    has_robot_of,
    needs_rollout,
    slots_of,
)
from deconflict.foresight.probability.tracked_robots import TrackedRobots
from deconflict.foresight.probability.waiting_robots import are_waiting
from deconflict.foresight.rollout.rollout import EVEN, NOBODY, RolloutInput, run_rollout
from deconflict.foresight.rollout.rollout_schedule import RolloutSchedule
from deconflict.foresight.rollout.start_samples import SAMPLES, START, quantiles
from deconflict.foresight.rollout.start_times import StartTimes
from deconflict.sweep.pair_choice import nearest_of_each
from ingest.batch import Bools, Floats, Ints

MOST_DRIVEN = 3
"""If a robot has too many others beside it, only those of its pairs are driven on that are among so many nearest
ones of either robot."""


class PairRollouts:
    """Runs the rollouts that are due, and keeps their results by pair."""

    def __init__(self, clearance_m: float, horizon_s: float, robots: TrackedRobots, pending: PendingForecasts) -> None:
        self._clearance_m, self._horizon_s = clearance_m, horizon_s
        self._robots, self._pending = robots, pending
        self.schedule = RolloutSchedule()
        """The results, and which robots are due."""

    @property
    def is_blocked(self) -> Bools:
        """(slots,) whether a standing robot has to wait for another one."""
        return self.schedule.waits_for != NOBODY

    def run_due(self, pairs: Pairs, due: Ints, start_times: StartTimes, now_s: float) -> None:
        """Run the rollout of the robots whose turn it is. Write its feature into the rows `due` of `pairs`, and into
        the rows of the robots that took part."""
        robots, is_crowded = self._robots, self._robots.is_crowded()
        near = pairs[needs_rollout(pairs, robots.absence, is_crowded)]
        a, b = slots_of(near["code"])
        slots = self.schedule.due(a, b, robots.key, now_s)
        if len(slots):
            rank = robots.slots.ranks()
            slots = slots[np.argsort(rank[slots])]  # so that the result does not depend on who came first
            nearest = _nearest_of_each(a, b, near["near_m"])
            watched = rows_of_pairs(a[nearest], b[nearest], slots, len(robots))
            result = run_rollout(self._input(slots, watched, start_times, now_s), self._horizon_s, self._clearance_m)
            is_swapped = rank[result.a] > rank[result.b]
            first, second = np.where(is_swapped, result.b, result.a), np.where(is_swapped, result.a, result.b)
            self.schedule.store(slots, result, codes(first, second), now_s)
            is_due = has_robot_of(pairs["code"], slots)
            is_due[due] = True
            due = np.flatnonzero(is_due)
        pairs["features"][due, DRIVEN] = self.schedule.features_of(pairs["code"][due])
        a, b = slots_of(pairs["code"][due])
        pairs["features"][due[is_crowded[a] | is_crowded[b]], DRIVEN] = EVEN

    def _input(self, slots: Ints, watched: Ints, start_times: StartTimes, now_s: float) -> RolloutInput:
        columns, newest = self._robots, self._pending.newest[slots]
        records = columns.records[slots]
        waiting = np.flatnonzero(are_waiting(records))
        starts_s = np.zeros((SAMPLES, len(slots)))
        if len(waiting):
            stood_s = now_s - records["stood_since_s"][waiting]
            part = quantiles(columns.key[slots[waiting]], START)
            starts_s[:, waiting] = start_times.late_s(records["kind"][waiting], stood_s, part)
        return RolloutInput(
            slot=slots,
            key=columns.key[slots],
            since_s=now_s - newest[:, 0],
            track=self._pending.history.track[slots],
            half_m=np.ascontiguousarray(columns.half_m[:, slots]),
            levels_m=np.ascontiguousarray(columns.levels_m[:, slots]),
            stands=columns.is_standing(slots),
            starts_s=starts_s,
            watched=watched,
        )


def _nearest_of_each(a: Ints, b: Ints, near_m: Floats) -> Ints:
    """Rows of the pairs of slots `a` and `b` (p,) that are among the `MOST_DRIVEN` nearest of either robot."""
    of_pair = np.tile(np.arange(len(a)), 2)
    rows = nearest_of_each(np.concatenate([a, b]), np.tile(near_m, 2), MOST_DRIVEN)
    return np.unique(of_pair[rows])


def rows_of_pairs(a: Ints, b: Ints, slots: Ints, of: int) -> Ints:
    """(p, 2) the rows in `slots` (n,), of `of` slots, of those pairs of slots `a` and `b` of which both are there, the
    lower row first."""
    row_of = np.full(of, -1)
    row_of[slots] = np.arange(len(slots))
    rows = np.sort(np.column_stack([row_of[a], row_of[b]]), axis=1)
    return np.ascontiguousarray(rows[rows[:, 0] >= 0])
