"""The longest tests begin first, each on another worker."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.helpers.order import LONGEST, dealt

TESTS = Path(__file__).parent
FILE = "deconflict/roles/processes/test_data_of_release.py"


def test_every_long_test_is_there() -> None:
    for begin in LONGEST:
        file, _, name = begin.partition("::")
        assert f"def {name or 'test_'}" in (TESTS / file).read_text(encoding="utf-8"), begin


@pytest.mark.parametrize("workers", [1, 4, 5])
def test_every_worker_begins_with_some_of_the_longest(workers: int) -> None:
    long = [*(f"{begin}{number}" for begin in LONGEST if begin != FILE for number in range(3))]
    together = [f"{FILE}::test_{number}" for number in range(3)]
    names = [
        f"tests/{name}" for name in (*(f"short/test.py::test_{number}" for number in range(600)), *together, *long)
    ]
    items: list[Any] = [SimpleNamespace(nodeid=name) for name in names]
    order = [item.nodeid for item in dealt(items, workers)]
    assert sorted(order) == sorted(names)
    at = 0
    for worker in range(workers):
        assert "short" not in order[at]
        at += (len(order) - at) // (workers - worker)
    first = order.index(f"tests/{together[0]}")
    assert order[first : first + 3] == [f"tests/{name}" for name in together]
