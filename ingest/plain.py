"""A plain status out of its bytes, or the points of a path alone, by what `ingest/letters.py` makes of the letters.

What it takes, `ingest/messages.py` and `ingest/paths.py` make the same of.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import isnan

import numpy as np

from ingest import paths, words
from ingest.conformance import Findings
from ingest.letters import HEAD_ROWS, MARKS, MOST, OF_DESTINATIONS, OF_PATH, read_points, read_status
from ingest.messages import Status
from ingest.paths import NO_PATH, Path, Points
from ingest.seam import Floats
from ingest.stamps import worth_s

_OF_STAMPS = (), ("stamp-no-offset",), ("stamp-offset-no-colon",)
"""Findings, by how a stamp departs."""
_RESOLUTIONS_S = [worth_s(digits) for digits in range(10)]
_REMEMBERED = 1024
"""Words and how they go together: the same few come again and again."""


def status(raw: bytes, names_as_uuid: str | None, findings: Findings) -> Status | None:
    """What a status says; None where it is left to others. Raises `RejectedError`."""
    rows, marks = np.empty((HEAD_ROWS + min(len(raw) // 16, MOST), 4)), np.empty(MARKS, np.int64)
    if not read_status(raw, rows, marks):
        return None
    pose, (z, linear_mps, turn_rad, _), (battery_pct, _, available_pct, _), ends_s = rows[:HEAD_ROWS].tolist()
    stamp_s, x, y, yaw_rad = pose
    at = marks.tolist()
    uuid_at, uuid_end, state_at, state_end, digits, departs, right, right_end, other, other_end = at[:OF_PATH]
    uuid = words.robot_uuid(raw[uuid_at:uuid_end].decode(), names_as_uuid, findings)
    state, known_state, datum, found = _said_of_it(
        departs,
        raw[state_at:state_end],
        raw[other:other_end] if other >= 0 else None,
        raw[right:right_end] if right >= 0 else None,
    )
    if found:
        findings.update(dict.fromkeys(found))
    path = destinations = NO_PATH
    if at[OF_DESTINATIONS] < at[OF_DESTINATIONS + 1]:
        told = _path(raw, rows, at[OF_DESTINATIONS:], ends_s[2:], findings)
        destinations = paths.checked_destinations(told, len(told.datums), stamp_s, findings)
    if at[OF_PATH] < at[OF_PATH + 1]:
        told = _path(raw, rows, at[OF_PATH:OF_DESTINATIONS], ends_s[:2], findings)
        path = paths.checked_path(told, len(told.datums), stamp_s, findings)
    return Status(
        uuid,
        stamp_s,
        _RESOLUTIONS_S[digits],
        state,
        known_state,
        x,
        y,
        z,
        yaw_rad,
        datum,
        None if isnan(linear_mps) else linear_mps,
        None if isnan(turn_rad) else turn_rad,
        None if isnan(available_pct) else 100.0 - available_pct,
        None if isnan(battery_pct) else battery_pct,
        (),
        destinations,
        path,
        tuple(findings),
    )


def points(text: bytes) -> Points | None:
    """The points of a JSON array of predicted locations, at least one; None where they are left to others."""
    rows = np.empty((min(len(text) // 16, MOST), 4))
    count, told = read_points(text, rows)
    if not count:
        return None
    findings: Findings = {}
    path = _path(text, rows, (0, count, *told), (float(rows[0, 0]), float(rows[count - 1, 0])), findings)
    return Points(path, tuple(findings))


def _path(text: bytes, rows: Floats, at: Sequence[int], ends_s: Sequence[float], findings: Findings) -> Path:
    """The points between two rows, at least one."""
    begin, end, right, right_end, other, other_end, departs = at
    datum, found = _said_of_points(
        departs,
        text[right:right_end] if right >= 0 else None,
        text[other:other_end] if other >= 0 else None,
    )
    if found:
        findings.update(dict.fromkeys(found))
    return Path(rows[begin:end], (datum,) * (end - begin), True, (ends_s[0], ends_s[1]))


@lru_cache(_REMEMBERED)
def _said_of_it(
    departs: int, state: bytes, right: bytes | None, other: bytes | None
) -> tuple[str, bool, str, tuple[str, ...]]:
    """A status's state, whether it is known, and datum, with the findings on its stamp and on these."""
    findings: Findings = dict.fromkeys(_OF_STAMPS[departs])
    name, known = words.state(state.decode(), findings)
    datum = words.datum(_decoded(right), _decoded(other), findings, empty="datum-missing")
    return name, known, datum, tuple(findings)


@lru_cache(_REMEMBERED)
def _said_of_points(departs: int, right: bytes | None, other: bytes | None) -> tuple[str, tuple[str, ...]]:
    """The datum of points, with the findings on their stamps and on that."""
    findings: Findings = dict.fromkeys(_OF_STAMPS[departs])
    return paths.datum(_decoded(right), _decoded(other), findings), tuple(findings)


def _decoded(letters: bytes | None) -> str | None:
    return None if letters is None else letters.decode()
