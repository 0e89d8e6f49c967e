"""Rebuilds the state of a fleet from the end of its message log."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from ingest.fleet.fleet import Fleet
from ingest.languages.front_ends import FRONT_ENDS
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Closed, Given, LogReader, Received

RECOVERED_SEGMENTS = 2
"""Newest segments of the log that are read at a start."""


class Recovered(NamedTuple):
    """What was read from a log."""

    messages: int
    """How many messages."""
    connection: int
    """The highest connection number in the log, 0 if it has none. New connections get higher numbers."""


def recover(
    fleet: Fleet, files: Sequence[Path], now_s: float, note_message: Callable[[int], object] = lambda _: None
) -> Recovered:
    """Restore the state of a fleet from the newest `files` of a log.

    Identities are read whatever their age, statuses only if they are too recent for their robot to be silent. Nothing
    is counted in the fleet's measures, since it was counted when it arrived. Calls `note_message` with the number of
    each message that was read, from 1.
    """
    measures, fleet.measures = fleet.measures, Measures()
    since_s, messages, connection = now_s - fleet.reading.silent_after_s, 0, 0
    for event in LogReader().read(files[-RECOVERED_SEGMENTS:]):
        if isinstance(event, Received | Closed):
            connection = max(connection, event.connection.id)
        if isinstance(event, Given):
            fleet.give(event.uuid, event.vendor)
        if not isinstance(event, Received) or event.refused or event.arrival_s > now_s:
            continue
        front_end = FRONT_ENDS[event.connection.language]
        if event.arrival_s >= since_s or not front_end.has_pose(event.raw, event.connection.topic):
            fleet.receive(event.raw, event.arrival_s, event.connection)
            messages += 1
            note_message(messages)
    fleet.measures = measures
    for robot in fleet.robots.values():
        robot.statuses = 0
    return Recovered(messages, connection)
