"""Flow against density."""

import pytest

from deconflict.contention.queues.zone_flow import ZoneFlow


def run(flow: ZoneFlow, seconds: int, inside: int, every_s: int) -> None:
    """So many are inside, and one leaves every so many seconds."""
    for t in range(seconds):
        flow.add_interval(1.0, inside, int(t % every_s == 0))


def test_flow_and_saturation_are_means_over_minutes() -> None:
    flow = ZoneFlow(capacity=4)
    run(flow, 3000, inside=2, every_s=5)
    assert flow.flow_per_s == pytest.approx(0.2, rel=0.05)
    assert flow.saturation == pytest.approx(0.5, rel=0.01)


def test_saturation_is_relative_to_the_density_of_the_greatest_flow() -> None:
    flow = ZoneFlow(capacity=10)
    run(flow, 600, inside=2, every_s=5)
    run(flow, 600, inside=3, every_s=3)
    run(flow, 600, inside=6, every_s=20)
    assert flow.saturation > 1.5
    assert flow.flow_per_s < 0.12
