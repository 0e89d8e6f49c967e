"""Rebuilds the state of a fleet from the end of its message log."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Closed, Reader, Received

RECOVERED_SEGMENTS = 2
"""Newest segments of the log that are read back at a start."""


class Recovered(NamedTuple):
    messages: int
    """How many were read again."""
    connection: int
    """The last that has a number in the log, 0 for none; each start numbers on from there."""


def recover(fleet: Fleet, files: Sequence[Path], now_s: float) -> Recovered:
    """Bring a fleet to what it was, from the end of the files of a log.

    Identities count whatever their age, statuses as far back as a robot is not yet silent. What is only repeated here
    was counted when it came, so nothing is counted again.
    """
    counted, fleet.measures = fleet.measures, Measures()
    since_s, messages, connection = now_s - fleet.reading.silent_after_s, 0, 0
    for event in Reader().read(files[-RECOVERED_SEGMENTS:]):
        if isinstance(event, Received | Closed):
            connection = max(connection, event.connection.id)
        if not isinstance(event, Received) or event.refused or event.arrival_s > now_s:
            continue
        if event.arrival_s >= since_s or b'"operationalState"' not in event.raw:
            fleet.receive(event.raw, event.arrival_s, event.connection)
            messages += 1
    fleet.measures = counted
    for robot in fleet.robots.values():
        robot.statuses = 0
    return Recovered(messages, connection)
