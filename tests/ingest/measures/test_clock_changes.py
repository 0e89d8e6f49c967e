"""A vendor's clocks, from its messages on."""

from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures import clock_changes
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Reading
from tests.helpers.saying import identity, status

NOW_S = 1_792_000_000.0


def hour(fast_s: float, from_s: int, until_s: int, robots: int = 3) -> dict[int, dict[tuple[str, ...], float]]:
    """By minute, how much clocks have changed that are fast for a while."""
    fleet, line, values = (
        Fleet(VendorRegistry(()), FrameRegistry((), ()), Reading(), Measures(), Quarantine()),
        Connection(1),
        {},
    )
    names = [f"A-{number}" for number in range(robots)]
    for name in names:
        fleet.receive(identity(name, NOW_S), NOW_S, line)
    for second in range(3600):
        now_s = NOW_S + second
        for name in names:
            stamp_s = now_s - 0.05 + (fast_s if from_s <= second < until_s else 0.0)
            fleet.receive(status(name, stamp_s), now_s, line)
        fleet.next_batch(now_s)
        if second % 60 == 0:
            fleet_report.measure(fleet, now_s)
            values[second // 60] = dict(fleet.measures.values[clock_changes.AMOUNTS["clock"]])
            since = fleet.measures.values[clock_changes.SINCE].get(("Alder", "clock"))
            assert since is None or abs(since - (NOW_S + from_s)) <= 60
    return values


def test_clocks_that_are_set_wrong_and_right_again_are_told_of_until_they_are_right() -> None:
    values = hour(3.0, 1800, 2700)
    assert all(values[minute] == {} for minute in range(30))
    assert all(abs(values[minute]["Alder",] + 3.0) < 0.1 for minute in range(33, 45))
    assert values[50] == {}


def test_clocks_that_were_always_wrong_have_not_changed() -> None:
    assert all(value == {} for value in hour(-7.0, 0, 3600, robots=1).values())
