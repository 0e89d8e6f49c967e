import numpy as np

from deconflict.sweep.robot_slots import RobotSlots


def test_a_robot_keeps_its_slot_and_the_next_new_robot_gets_the_slot_that_was_freed_last() -> None:
    slots = RobotSlots()
    assert slots.assign(["a", "b", "c"])[0].tolist() == [0, 1, 2]
    assert slots.release(["a", "nobody", "b"]).tolist() == [0, 1]
    assert slots.uuids == ["", "", "c"]
    assigned, new_rows = slots.assign(["c", "d", "e", "f"])
    assert (assigned.tolist(), new_rows) == ([2, 1, 0, 3], [1, 2, 3])
    assert (len(slots), slots.find(["a", "f"]).tolist()) == (4, [-1, 3])


def test_a_new_robot_that_stands_in_a_batch_twice_gets_one_slot() -> None:
    slots = RobotSlots()
    assert slots.assign(["a", "a"])[0].tolist() == [0, 0]
    assert len(slots) == 1


def test_ranks_are_the_places_of_the_uuids_in_ascending_order_whoever_comes_and_leaves() -> None:
    rng, slots = np.random.default_rng(5), RobotSlots()
    for _ in range(200):
        uuids = [f"{number:02}" for number in rng.integers(0, 60, rng.integers(1, 9))]
        if rng.random() < 0.5:
            slots.assign(uuids)
        else:
            slots.release(uuids)
        if rng.random() < 0.7:
            ascending = sorted(slots.by_uuid)
            assert slots.ranks()[slots.find(ascending)].tolist() == list(range(len(ascending)))
