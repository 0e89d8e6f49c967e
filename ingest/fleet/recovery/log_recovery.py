"""Rebuilds the state of a fleet from the end of its message log, and from the messages that were kept beside it."""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from deconflict_client.counted_nouns import count_of
from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.languages.front_ends import FRONT_ENDS
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Closed, Event, LogReader, Received, begun_s
from ingest.recording.log_segments import segments, text_bytes
from ingest.recording.operator_events import Given, OffFloorMark

log = logging.getLogger(__name__)

FEWEST_SEGMENTS = 2
"""Newest segments of the log that are read at a start, however large they are."""
MOST_BYTES = 128 << 20
"""Further segments are read up to this length of lines in all, if robots may not be silent since."""


class Recovered(NamedTuple):
    """What was read from a log."""

    messages: int
    """How many messages."""
    connection: int
    """The highest connection number in the log, 0 if it has none. New connections get higher numbers."""


def recover(
    fleet: Fleet,
    files: Sequence[Path],
    now_s: float,
    note_message: Callable[[int], object] = lambda _: None,
    kept: Iterable[Received] = (),
) -> Recovered:
    """Restore the state of a fleet from the newest `files` of a log, and from `kept` messages, the oldest first.

    Identities are read whatever their age, statuses only if they are too recent for their robot to be silent. A robot
    of which only an older message is known counts as silent from now on, so it is not forgotten at once. Nothing
    is counted in the fleet's measures, since it was counted when it arrived. Calls `note_message` with the number of
    each message that was read, from 1.
    """
    measures, fleet.measures = fleet.measures, Measures()
    since_s, messages, connection = now_s - fleet.reading.silent_after_s, 0, 0
    for event in _in_order(kept, _logged(files, since_s)):
        if isinstance(event, Received | Closed):
            connection = max(connection, event.connection.id)
        if isinstance(event, Given):
            fleet.give(event.uuid, event.vendor)
        if isinstance(event, OffFloorMark) and event.at_s <= now_s:
            fleet.off_floor.note(event)
        if not isinstance(event, Received) or event.refused or event.arrival_s > now_s:
            continue
        front_end = FRONT_ENDS[event.connection.language]
        if event.arrival_s >= since_s or not front_end.has_pose(event.raw, event.connection.topic):
            fleet.receive_recorded(event)
            messages += 1
            note_message(messages)
    fleet.measures = measures
    fleet.owners.admission.resume()
    for robot in fleet.robots.values():
        robot.statuses = 0
        robot.arrival_s = max(robot.arrival_s, since_s)
    return Recovered(messages, connection)


def summary(fleet: Fleet, found: Recovered) -> str:
    """What came back, for the service's own log. The register of owners has been read by then."""
    unidentified = fleet_report.unidentified(fleet)
    owned = sum(fleet.owners.owner(uuid) is not None for uuid in unidentified)
    seen = sum(robot.seen is not None for robot in fleet.robots.values())
    return (
        f"the floor is restored: {count_of(len(fleet.robots), 'robot')}, {seen} of them with a position; "
        f"{count_of(len(unidentified), 'has', 'have')} sent no identity report, and of these "
        f"{count_of(owned, 'has', 'have')} an owner; {count_of(found.messages, 'message was', 'messages were')} read"
    )


def _logged(files: Sequence[Path], since_s: float) -> Iterator[Event]:
    """The events of the newest segments, up to the first that can't be read: part of a floor is better than none."""
    try:
        yield from LogReader().read(_newest(files, since_s))
    except OSError as error:
        log.error("the recording can't be read any further: %s; check its disk and its owner", error)


def _newest(files: Sequence[Path], since_s: float) -> list[Path]:
    """The newest segments: those with lines since a time, but not many bytes, and at least a few whatever they are."""
    newest: list[Path] = []
    total_bytes = 0
    for file in reversed([segment for path in files if path.exists() for segment in segments(path)]):
        total_bytes += text_bytes(file)
        is_enough = total_bytes > MOST_BYTES or (newest and begun_s(newest[-1]) <= since_s)
        if len(newest) >= FEWEST_SEGMENTS and is_enough:
            break
        newest.append(file)
    return newest[::-1]


def _in_order(kept: Iterable[Received], logged: Iterable[Event]) -> Iterator[Event]:
    """The events of a log, and each kept message before the first that arrived later."""
    waiting = deque(kept)
    for event in logged:
        while waiting and isinstance(event, Received) and waiting[0].arrival_s <= event.arrival_s:
            yield waiting.popleft()
        yield event
    yield from waiting
