"""What the clock said while a service ran, as notes in its data directory."""

from pathlib import Path

import msgspec

from ingest.recording.clock_notes import FILE_NAME, HOUR_S, HOURS, ClockNotes


def put_notes(data: Path, ended_s: float, hours: int = HOURS) -> ClockNotes:
    """Notes of a service that ran without a break, with this clock, and ended at this time."""
    notes = ClockNotes(tuple(ended_s - ago * HOUR_S for ago in reversed(range(hours))), last_s=ended_s)
    data.mkdir(parents=True, exist_ok=True)
    (data / FILE_NAME).write_bytes(msgspec.json.encode(notes))
    return notes
