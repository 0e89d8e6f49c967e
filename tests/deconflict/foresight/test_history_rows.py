import numpy as np

from deconflict.foresight.history_rows import HistoryRows


def test_a_robot_that_rests_gives_its_row_to_the_next() -> None:
    rows = HistoryRows()
    rows.grow(4)
    assert rows.assign(np.array([2, 0])).tolist() == [0, 1]
    assert rows.assign(np.array([0, 3])).tolist() == [1, 2]
    assert rows.slots[:4].tolist() == [2, 0, 3, -1]
    assert rows.release(np.array([1, 0])).tolist() == [1]
    assert rows.of_slot.tolist() == [-1, -1, 0, 2]
    assert rows.assign(np.array([1])).tolist() == [1]


def test_robots_that_come_and_rest_need_no_more_rows() -> None:
    rows = HistoryRows()
    rows.grow(500)
    for slot in range(500):
        rows.assign(np.array([slot]))
        rows.release(np.array([slot]))
    assert len(rows) <= 20


def test_rows_of_many_that_rest_are_dropped_behind_the_last_that_reports() -> None:
    rows = HistoryRows()
    rows.grow(300)
    rows.assign(np.arange(300))
    rows.release(np.arange(100, 300))
    assert len(rows) == 100
    assert rows.assign(np.array([200, 5])).tolist() == [100, 5]
