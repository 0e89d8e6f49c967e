"""No schedule of a few jobs costs less than the bound, and often one costs as much."""

from itertools import permutations, product

from hypothesis import given
from hypothesis import strategies as st

from deconflict.contention.queues.place_group import Task, least_weighted_ends


def least(tasks: list[Task], places: int) -> int:
    """Of every order at every choice of places."""
    costs = []
    for order in permutations(tasks):
        for chosen in product(range(places), repeat=len(tasks)):
            free, cost = [0] * places, 0
            for task, place in zip(order, chosen, strict=True):
                free[place] = max(free[place], task.release) + task.length
                cost += task.weight * free[place]
            costs.append(cost)
    return min(costs)


def tasks(weights: st.SearchStrategy[int], most: int) -> st.SearchStrategy[list[Task]]:
    search_strategy = st.builds(Task, st.integers(0, 300), st.integers(1, 100), weights)
    return st.lists(search_strategy, min_size=1, max_size=most)


@given(tasks(st.integers(0, 9), 4), st.integers(1, 2))
def test_no_order_costs_less(given_: list[Task], places: int) -> None:
    assert least_weighted_ends(given_, places) <= least(given_, places)


@given(tasks(st.just(3), 5))
def test_no_order_of_one_weight_at_one_place_costs_less(given_: list[Task]) -> None:
    assert least_weighted_ends(given_, 1) <= least(given_, 1)


@given(st.lists(st.integers(1, 50), min_size=1, max_size=5))
def test_the_bound_is_exact_for_arrived_jobs_of_one_weight(lengths: list[int]) -> None:
    there = [Task(0, length, 1) for length in lengths]
    assert least_weighted_ends(there, 1) == least(there, 1)


@given(st.lists(st.tuples(st.integers(1, 50), st.integers(1, 9)), min_size=1, max_size=4))
def test_the_bound_is_exact_for_arrived_jobs_at_one_place(given_: list[tuple[int, int]]) -> None:
    there = [Task(0, length, weight) for length, weight in given_]
    assert least_weighted_ends(there, 1) == least(there, 1)
