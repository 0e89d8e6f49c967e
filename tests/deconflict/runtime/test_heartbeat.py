import subprocess
import sys
from collections.abc import Iterator

import pytest

from deconflict.runtime.heartbeat import LONG_SILENCE_LIMIT_S, SILENCE_LIMIT_S, HeartbeatMonitor
from tests.helpers.patience import PATIENCE_S

ROLE = """
from deconflict.runtime.heartbeat import Heartbeat
import sys, threading
ended, heartbeat = threading.Event(), Heartbeat()
heartbeat.at_end(ended.set)
{then}
ended.wait(60)
sys.exit(7)
"""


@pytest.fixture
def monitor() -> Iterator[HeartbeatMonitor]:
    monitor = HeartbeatMonitor(0.0)
    yield monitor
    monitor.close()


def hung_after_s(monitor: HeartbeatMonitor, since_s: float, step_s: float = 0.5) -> float:
    """How long until the role hangs, with a check every `step_s`."""
    now_s = since_s
    while not monitor.hangs(now_s):
        now_s += step_s
    return now_s - since_s


def test_a_silent_role_hangs_once_each_time_the_limit_passes(monitor: HeartbeatMonitor) -> None:
    assert LONG_SILENCE_LIMIT_S < hung_after_s(monitor, 0.0) <= LONG_SILENCE_LIMIT_S + 1.0
    assert LONG_SILENCE_LIMIT_S <= hung_after_s(monitor, LONG_SILENCE_LIMIT_S + 1.0) <= LONG_SILENCE_LIMIT_S + 1.0


@pytest.mark.parametrize("allowed_s", [SILENCE_LIMIT_S, LONG_SILENCE_LIMIT_S])
def test_the_last_heartbeat_sets_the_silence_limit(monitor: HeartbeatMonitor, allowed_s: int) -> None:
    monitor.hangs(100.0)
    monitor.theirs.send(bytes([LONG_SILENCE_LIMIT_S]))
    monitor.theirs.send(bytes([allowed_s]))
    assert allowed_s < hung_after_s(monitor, 100.0) <= allowed_s + 1.0


def test_no_role_hangs_because_the_supervisor_was_stopped(monitor: HeartbeatMonitor) -> None:
    monitor.theirs.send(bytes([SILENCE_LIMIT_S]))
    assert not any(monitor.hangs(now_s) for now_s in (0.0, 0.5, 5000.0, 5000.5, 90_000.0))


def process_of(monitor: HeartbeatMonitor, then: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", ROLE.format(then=then)]
    process = subprocess.Popen(command, stdin=monitor.theirs.fileno(), stdout=subprocess.PIPE)
    monitor.theirs.close()
    return process


def test_a_role_ends_with_its_supervisor(monitor: HeartbeatMonitor) -> None:
    with process_of(monitor, "heartbeat.beat(5)\nprint('sent', flush=True)") as role:
        assert role.stdout
        assert role.stdout.readline() == b"sent\n"
        assert 5 < hung_after_s(monitor, 0.0) <= 6
        assert role.poll() is None
        monitor.close()
        assert role.wait(PATIENCE_S) == 7


def test_a_role_ends_with_a_supervisor_that_has_not_read_its_last_heartbeat(monitor: HeartbeatMonitor) -> None:
    with process_of(monitor, "heartbeat.beat()\nprint('sent', flush=True)") as role:
        assert role.stdout
        assert role.stdout.readline()
        monitor.close()
        assert role.wait(PATIENCE_S) == 7


def test_a_role_never_waits_for_a_supervisor_that_does_not_read(monitor: HeartbeatMonitor) -> None:
    with process_of(monitor, "for _ in range(100_000): heartbeat.beat()\nsys.exit(3)") as role:
        assert role.wait(PATIENCE_S) == 3


def test_a_role_without_a_supervisor_sends_nothing() -> None:
    command = [sys.executable, "-c", ROLE.format(then="heartbeat.beat()")]
    assert subprocess.run(command, stdin=subprocess.DEVNULL, timeout=PATIENCE_S, check=False).returncode == 7
