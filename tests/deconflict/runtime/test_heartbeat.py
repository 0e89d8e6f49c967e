"""The line between the supervisor and a role that goes on, hangs or is not to blame."""

import subprocess
import sys
from collections.abc import Iterator

import pytest

from deconflict.runtime.heartbeat import LONG_S, SILENT_S, Watching
from tests.helpers.patience import PATIENCE_S

ROLE = """
from deconflict.runtime.heartbeat import Lifeline
import sys, threading
ended, line = threading.Event(), Lifeline()
line.at_end(ended.set)
{then}
ended.wait(60)
sys.exit(7)
"""


@pytest.fixture
def watching() -> Iterator[Watching]:
    one = Watching(0.0)
    yield one
    one.close()


def hung_after_s(one: Watching, since_s: float, step_s: float = 0.5) -> float:
    """How long until it is told, for who looks every `step_s`."""
    now_s = since_s
    while not one.hangs(now_s):
        now_s += step_s
    return now_s - since_s


def test_who_never_speaks_hangs_and_is_told_of_once_each_time(watching: Watching) -> None:
    assert LONG_S < hung_after_s(watching, 0.0) <= LONG_S + 1.0
    assert LONG_S <= hung_after_s(watching, LONG_S + 1.0) <= LONG_S + 1.0


@pytest.mark.parametrize("allowed_s", [SILENT_S, LONG_S])
def test_who_spoke_may_be_silent_for_as_long_as_it_said_last(watching: Watching, allowed_s: int) -> None:
    watching.hangs(100.0)
    watching.theirs.send(bytes([LONG_S]))
    watching.theirs.send(bytes([allowed_s]))
    assert allowed_s < hung_after_s(watching, 100.0) <= allowed_s + 1.0


def test_a_supervisor_that_stood_still_blames_nobody(watching: Watching) -> None:
    watching.theirs.send(bytes([SILENT_S]))
    assert not any(watching.hangs(now_s) for now_s in (0.0, 0.5, 5000.0, 5000.5, 90_000.0))


def process_of(watching: Watching, then: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", ROLE.format(then=then)]
    started = subprocess.Popen(command, stdin=watching.theirs.fileno(), stdout=subprocess.PIPE)
    watching.theirs.close()
    return started


def test_a_role_is_heard_and_ends_with_its_supervisor(watching: Watching) -> None:
    with process_of(watching, "line.goes_on(5)\nprint('said', flush=True)") as role:
        assert role.stdout
        assert role.stdout.readline() == b"said\n"
        assert 5 < hung_after_s(watching, 0.0) <= 6
        assert role.poll() is None
        watching.close()
        assert role.wait(PATIENCE_S) == 7


def test_a_role_ends_with_a_supervisor_that_has_not_heard_its_last_word(watching: Watching) -> None:
    with process_of(watching, "line.goes_on()\nprint('said', flush=True)") as role:
        assert role.stdout
        assert role.stdout.readline()
        watching.close()
        assert role.wait(PATIENCE_S) == 7


def test_a_role_never_waits_for_a_supervisor_that_does_not_listen(watching: Watching) -> None:
    with process_of(watching, "for _ in range(100_000): line.goes_on()\nsys.exit(3)") as role:
        assert role.wait(PATIENCE_S) == 3


def test_a_role_without_a_supervisor_speaks_to_nobody() -> None:
    command = [sys.executable, "-c", ROLE.format(then="line.goes_on()")]
    assert subprocess.run(command, stdin=subprocess.DEVNULL, timeout=PATIENCE_S, check=False).returncode == 7
