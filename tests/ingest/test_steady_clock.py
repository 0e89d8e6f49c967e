from itertools import pairwise

import pytest

from ingest.clocks import SLEW, SteadyClock


class Host:
    """A host whose clock can be set."""

    def __init__(self) -> None:
        self.wall_s, self.up_s = 1_790_000_000.0, 50.0

    def passes(self, seconds: float) -> None:
        self.wall_s += seconds
        self.up_s += seconds


@pytest.fixture
def host() -> Host:
    return Host()


@pytest.fixture
def clock(host: Host) -> SteadyClock:
    return SteadyClock(lambda: host.wall_s, lambda: host.up_s)


def test_it_is_the_hosts_clock_while_nobody_sets_that(host: Host, clock: SteadyClock) -> None:
    for _ in range(100):
        host.passes(0.1)
        assert clock() == pytest.approx(host.wall_s, abs=1e-6)


@pytest.mark.parametrize("step_s", [-7200.0, 7200.0])
def test_a_step_is_told_once_and_never_taken_over_at_once(
    host: Host, clock: SteadyClock, step_s: float, caplog: pytest.LogCaptureFixture
) -> None:
    before_s = clock()
    host.wall_s += step_s
    for tick in range(1, 101):
        host.passes(0.1)
        assert clock() == pytest.approx(before_s + 0.1 * tick, abs=0.1 * tick * SLEW + 1e-6)
    assert clock.off_s == pytest.approx(step_s, rel=0.01)
    (log_record,) = caplog.records
    assert f"set by {step_s:+.1f} s" in log_record.getMessage()


def test_it_leans_towards_the_host_until_it_is_there_and_never_goes_back(host: Host, clock: SteadyClock) -> None:
    host.wall_s -= 30.0
    told_s = [clock()]
    for _ in range(4000):
        host.passes(1.0)
        told_s.append(clock())
    assert all(later > earlier for earlier, later in pairwise(told_s))
    assert told_s[-1] == pytest.approx(host.wall_s, abs=1e-3)
