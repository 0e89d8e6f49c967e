"""What all tests share."""

import signal
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

from tests.helpers.order import dealt, set_priority
from tests.helpers.patience import PATIENCE_S

hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")

TESTS = Path(__file__).parent
SLOW = (
    "benchmarks",
    "deconflict/cluster",
    "deconflict/engine/test_recorded_traffic.py",
    "deconflict/operator",
    "deconflict/roles",
    "deconflict/runtime/test_logging_setup.py",
    "deconflict/runtime/test_systemd.py",
    "deconflict/settings/test_hot_reload.py",
    "deconflict/settings/importers",
    "deconflict/simulation",
    "deconflict/sweep",
    "fuzz",
    "ingest/port",
    "ingest/recording",
    "ingest/test_kernels.py",
    "inventory",
    "metrics/monitoring",
    "metrics/replay",
    "metrics/report",
    "metrics/scoring",
    "test_examples.py",
    "test_oracle.py",
)
"""Folders and files whose tests start processes, play long scenes, or look at ten thousand cases."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not even import the slow tests for `make check`."""
    return (config.option.markexpr == "not slow" and is_slow(collection_path)) or None


@pytest.fixture
def ends_in_time() -> Iterator[None]:
    """A test that waits for a file without end fails."""

    def fail(*_: object) -> None:
        raise AssertionError(f"it still waits after {PATIENCE_S:g} s")

    before = signal.signal(signal.SIGALRM, fail)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE_S)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


def is_slow(path: Path) -> bool:
    return path.is_relative_to(TESTS) and path.relative_to(TESTS).as_posix().startswith(SLOW)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Before its fixtures, as they start processes."""
    if isinstance(item, pytest.Function):
        set_priority(item)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the slow tests: `make check` leaves them out. On several workers the longest begin first."""
    for item in items:
        if is_slow(item.path):
            item.add_marker("slow")
    if workers := getattr(config, "workerinput", {}).get("workercount"):
        items[:] = dealt(items, workers)
