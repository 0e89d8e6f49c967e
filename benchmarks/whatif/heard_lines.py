"""The messages of a simulated floor as the service hears them, turned into a recorded floor."""

from collections.abc import Iterable

from benchmarks.planned_floors.logs.messages import Line
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import DEFAULT
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from metrics.whatif.recorded_tracks import RecordedFloor, TrackReader

TICK_S = 0.25


def heard(lines: Iterable[Line]) -> RecordedFloor:
    """What the service hears of robots, without people."""
    fleet, reader, connection = fast_fleet_of(DEFAULT, Measures()), TrackReader(DEFAULT), Connection(1, "", "/", None)
    ordered = sorted(lines)
    next_s, is_first = ordered[0].received_s + TICK_S, True
    for line in ordered:
        while line.received_s > next_s:
            reader.add(fleet.next_batch(next_s, is_first))
            next_s, is_first = next_s + TICK_S, False
        fleet.receive(line.message.encode(), line.received_s, connection)
    return reader.floor()
