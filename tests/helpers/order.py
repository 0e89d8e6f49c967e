"""How tests share a machine: for several workers the longest begin first, and what is timed goes before the rest."""

import inspect
import os
from collections.abc import Iterator, Sequence
from functools import cache

import pytest

WAITING = (
    "deconflict/simulation/drills/test_drill_run.py::",
    "deconflict/cluster/test_brokers_in_cluster.py::",
    "deconflict/cluster/test_own_ingest.py::",
    "deconflict/cluster/nats/test_three_servers.py::",
    "deconflict/roles/test_faulty_files.py::",
    "deconflict/roles/test_disk_faults.py::",
    "deconflict/roles/processes/test_unfit_files.py::test_a_service",
    "metrics/monitoring/test_prometheus.py::",
    "deconflict/roles/processes/test_data_of_release.py",
    "deconflict/simulation/test_demo.py::test_the_demo_ends",
    "metrics/replay/test_virtual_agvs.py::",
    "inventory/test_inventory.py::test_a_running_service",
    "benchmarks/test_attack.py::test_beside_every_attack",
)
COMPUTING = (
    "metrics/replay/test_busy_floor_boxes.py",
    "deconflict/cluster/judging/test_hand_overs.py",
    "benchmarks/planned_floors/comparison/test_braking_for_an_hour.py::",
    "deconflict/simulation/driving/test_traffic.py",
    "deconflict/simulation/test_standoff_scene.py::",
    "benchmarks/test_decisions.py::",
    "metrics/whatif/test_whatif_question.py",
    "benchmarks/test_situation_counts.py",
    "metrics/replay/test_replay.py::test_straight_forecasts",
    "benchmarks/test_less_told.py::test_the_command",
    "metrics/replay/test_replay.py::test_a_perfect_vendor_of_real_motion",
    "inventory/test_inventory.py::test_nothing",
    "benchmarks/closed_loop/test_cells.py::",
)
LONGEST = (*WAITING, *COMPUTING)
"""What begins so takes the longest. What waits in real time comes first, and before others what leaves the cores free:
robots have to be heard in time. With "::" each test may run on another worker; without, the tests of a file stay
together, as they share what they have made."""

TIMED = (*WAITING, "deconflict/cluster", "deconflict/operator", "deconflict/roles", "deconflict/runtime", "ingest/port")
"""What begins so hears robots or people by the clock. So does each test that is a coroutine."""
NICENESS = 10
"""Of all other tests, so that those by the clock find a processor on a slow machine, too."""


@cache
def may_be_raised() -> bool:
    """Whether this process may take back a lower priority."""
    try:
        os.setpriority(os.PRIO_PROCESS, 0, 1)
        os.setpriority(os.PRIO_PROCESS, 0, 0)
    except PermissionError:
        return False
    return True


def set_priority(item: pytest.Function) -> None:
    """Set the priority of this process, and of those that it will start, for a test."""
    is_timed = item.nodeid.removeprefix("tests/").startswith(TIMED) or inspect.iscoroutinefunction(item.obj)
    if may_be_raised():
        os.setpriority(os.PRIO_PROCESS, 0, 0 if is_timed else NICENESS)


def dealt(items: Sequence[pytest.Item], workers: int) -> list[pytest.Item]:
    """The tests, so that each of as many equal parts as there are workers begins with some of the longest.

    xdist gives each worker one of these parts. Without it they differ by more than a minute at the end.
    """
    groups: dict[tuple[int, str], list[pytest.Item]] = {}
    rest = []
    for item in items:
        name = item.nodeid.removeprefix("tests/")
        rank = next((rank for rank, begin in enumerate(LONGEST) if name.startswith(begin)), None)
        if rank is None:
            rest.append(item)
        else:
            groups.setdefault((rank, name if "::" in LONGEST[rank] else ""), []).append(item)
    long = [groups[key] for key in sorted(groups)]
    return [item for part in _parts(long, rest, workers) for item in part]


def _parts(long: Sequence[list[pytest.Item]], rest: list[pytest.Item], workers: int) -> Iterator[list[pytest.Item]]:
    left, at = sum(map(len, long)) + len(rest), 0
    for worker in range(workers):
        begin = [item for group in long[worker::workers] for item in group]
        size = left // (workers - worker)
        until = at + max(size - len(begin), 0)
        yield begin + rest[at:until]
        left, at = left - len(begin) - (until - at), until
