"""Which robots are due to be driven on, and the results that are kept."""

import numpy as np
import pytest

from deconflict.foresight.probability.pair_table import codes
from deconflict.foresight.rollout.rollout import NEVER, NOBODY, RolloutResult
from deconflict.foresight.rollout.rollout_schedule import EVERY_S, KEYS, MOST, MOST_PER_S, RolloutSchedule
from ingest.batch import Ints

NOW_S = 1_790_000_000.0
KEY = np.array([0, KEYS // 3, KEYS // 2, KEYS // 5, KEYS // 7, 3 * KEYS // 4])


def new_schedule() -> RolloutSchedule:
    schedule = RolloutSchedule()
    schedule.grow(len(KEY))
    return schedule


def slots(*numbers: int) -> Ints:
    return np.array(numbers, np.int64)


def driven(schedule: RolloutSchedule, a: int, b: int, now_s: float, waits_for: int = NOBODY) -> None:
    result = RolloutResult(slots(a), slots(b), np.array([[3.0]]), slots(waits_for, NOBODY))
    schedule.store(slots(a, b), result, codes(slots(a), slots(b)), now_s)


def test_islands_take_turns_and_each_has_one_in_every_period() -> None:
    schedule, turns = new_schedule(), []
    for tick in range(20):
        now_s = NOW_S + tick * EVERY_S / 10
        due = schedule.due(slots(0, 1, 3), slots(1, 2, 4), KEY, now_s)
        if len(due):
            schedule.store(
                due, RolloutResult(due[:0], due[:0], np.zeros((0, 1)), np.full(len(due), NOBODY)), due[:0], now_s
            )
        turns.append(due.tolist())
    assert turns[0] == [0, 1, 2, 3, 4], "none was driven before"
    assert sorted(map(tuple, filter(None, turns[1:11]))) == [(0, 1, 2), (3, 4)]
    assert sorted(map(tuple, filter(None, turns[11:]))) == sorted(map(tuple, filter(None, turns[1:10])))


def test_results_of_a_pair_are_kept_until_its_next_turn() -> None:
    schedule = new_schedule()
    driven(schedule, 1, 2, NOW_S)
    driven(schedule, 3, 4, NOW_S)
    asked = codes(slots(1, 0, 3), slots(2, 5, 4))
    assert schedule.features_of(asked).tolist() == [[3.0], NEVER.tolist(), [3.0]]
    schedule.store(
        slots(1, 2), RolloutResult(slots(), slots(), np.zeros((0, 1)), slots(NOBODY, NOBODY)), slots(), NOW_S + 1
    )
    assert schedule.features_of(asked).tolist() == [NEVER.tolist(), NEVER.tolist(), [3.0]]


def test_a_robot_that_is_near_nobody_waits_for_nobody() -> None:
    schedule = new_schedule()
    driven(schedule, 1, 2, NOW_S, waits_for=2)
    assert schedule.waits_for[1] == 2
    schedule.due(slots(3), slots(4), KEY, NOW_S + 0.1)
    assert schedule.waits_for[1] == NOBODY
    assert schedule.features_of(codes(slots(1), slots(2))).tolist() == [NEVER.tolist()]


def test_another_robot_in_a_slot_has_no_results() -> None:
    schedule = new_schedule()
    driven(schedule, 1, 2, NOW_S, waits_for=2)
    schedule.forget(slots(2))
    assert schedule.features_of(codes(slots(1), slots(2))).tolist() == [NEVER.tolist()]


def test_if_many_are_due_the_most_recently_driven_wait_longest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deconflict.foresight.rollout.rollout_schedule.MOST", 2)
    schedule, pairs = new_schedule(), (slots(0, 2, 4), slots(1, 3, 5))
    driven_slots = []
    for look in range(3):
        due = schedule.due(*pairs, KEY, NOW_S + 10 * look)
        driven_slots.append(due.tolist())
        result = RolloutResult(slots(), slots(), np.zeros((0, 1)), np.full(len(due), NOBODY))
        schedule.store(due, result, slots(), NOW_S + 10 * look)
    assert sorted(slot for due in driven_slots for slot in due) == [0, 1, 2, 3, 4, 5]
    assert schedule.due(*pairs, KEY, NOW_S + 30).tolist() == driven_slots[0]


def test_frequent_looks_drive_on_no_more_robots_a_second() -> None:
    schedule, robots, looks = new_schedule(), 2 * int(MOST_PER_S), 100
    key = np.zeros(robots, np.int64)
    schedule.grow(robots)
    driven_on = 0
    for look in range(looks):
        now_s = NOW_S + look / looks
        due = schedule.due(np.arange(0, robots, 2), np.arange(1, robots, 2), key, now_s)
        result = RolloutResult(slots(), slots(), np.zeros((0, 1)), np.full(len(due), NOBODY))
        schedule.store(due, result, slots(), now_s)
        driven_on += len(due)
    assert 0 <= driven_on - MOST_PER_S <= MOST + looks
