"""Whose advice the robots of a log may have heard."""

from deconflict.site import DEFAULT
from ingest.connection import Connection
from ingest.playback import Event, Received, Tick
from metrics.passes import Reading
from tests.saying import identity

NOW_S = 1_790_000_000.0


def heard(*events: Event) -> list[bool]:
    reading = Reading(DEFAULT)
    return [one.heard for one in [*reading.take(events), *reading.finish()]]


def said(at_s: float) -> Received:
    return Received(identity("A-1", NOW_S), NOW_S + at_s, Connection(1, "peer"))


def test_robots_of_the_services_own_recording_heard_its_advice_and_those_of_other_logs_did_not() -> None:
    assert heard(said(0.0), Tick(NOW_S + 0.1), said(0.2), Tick(NOW_S + 0.3)) == [True, True]
    others = heard(said(0.0), said(1.0))
    assert len(others) >= 4
    assert not any(others)
