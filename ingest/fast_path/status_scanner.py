"""Reads plain statuses from their bytes with `scanner_kernels`.

`ingest/languages/massrobotics/parser.py` gives the same results, but slower.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import isnan

import msgspec
import numpy as np

from ingest.batch import Amounts, Floats
from ingest.fast_path.scanner_kernels import (
    AMOUNTS_ROW,
    HEAD_ROWS,
    LEAST_POINT_LENGTH,
    MARKS,
    OF_DESTINATIONS,
    OF_PATH,
    STAMP_DIGITS,
    UUID_BEGIN,
    UUID_END,
    read_status,
)
from ingest.languages.massrobotics import path_points, vocabulary
from ingest.languages.massrobotics.amounts import HOUR_S
from ingest.languages.massrobotics.parser import DATUM_PATH, rejection
from ingest.languages.model import NO_PATH, Path, Rejection, Status
from ingest.languages.rules import Findings, Oddity, RejectedError
from ingest.languages.timestamps import digit_resolution_s, write

_STAMP_FINDINGS = (), ("stamp-no-offset",), ("stamp-offset-no-colon",)
"""By the deviation of a stamp that `scanner_kernels` notes."""


class _Stamped(msgspec.Struct):
    """The stamp of a status, as it was sent."""

    timestamp: str


_STAMPED = msgspec.json.Decoder(_Stamped)
_RESOLUTIONS_S = [digit_resolution_s(digits) for digits in range(10)]
_CACHED = 1024
"""Combinations of texts that are cached: robots send the same few again and again."""
PointTexts = tuple[str, tuple[str, ...]]
"""The datum of points, and the deviations of their stamps and their datum."""


class StatusTexts(msgspec.Struct, frozen=True, gc=False, eq=False):
    """The meaning of the texts of a status, except its UUID. Statuses with the same texts share one object."""

    state: str
    known_state: bool
    datum: str
    findings: tuple[str, ...]
    """Deviations of its stamp, state and datum."""
    oddities: tuple[Oddity, ...]
    """Those of state and datum, named."""
    path: PointTexts | None
    """None if there are no points."""
    destinations: PointTexts | None
    """None if there are none."""


class ScannedStatus(msgspec.Struct, frozen=True, gc=False, eq=False):
    """A plain status whose bytes were scanned."""

    raw: bytes
    rows: Floats
    """(r, 4) numbers of the status, as `scanner_kernels` writes them."""
    marks: list[int]
    """Where its texts and points are, as `scanner_kernels` writes them."""
    texts: StatusTexts

    @property
    def uuid(self) -> bytes:
        """As it was sent."""
        return self.raw[self.marks[UUID_BEGIN] : self.marks[UUID_END]]

    @property
    def stamp_s(self) -> float:
        return self.rows.item(0)

    @property
    def stamp_resolution_s(self) -> float:
        return _RESOLUTIONS_S[self.marks[STAMP_DIGITS]]

    @property
    def amounts(self) -> Amounts:
        battery_pct, run_time_left_h, available_pct, _ = self.rows[AMOUNTS_ROW].tolist()
        return Amounts(battery_pct, run_time_left_h * HOUR_S, 100.0 - available_pct)

    def message(self, names_as_uuid: str | None) -> Status | Rejection:
        """The same as `parser.read`: the status, or a rejection if its UUID can't be read."""
        findings = Findings()
        try:
            uuid = vocabulary.robot_uuid(self.uuid.decode(), names_as_uuid, findings)
        except RejectedError as rejected:
            return rejection(rejected, self.uuid.decode(), names_as_uuid, findings)
        return self._status(uuid, findings)

    def _status(self, uuid: str, findings: Findings) -> Status:
        rows, marks, texts = self.rows, self.marks, self.texts
        pose, (z, linear_mps, turn_rad, _), _, ends_s = rows[:HEAD_ROWS].tolist()
        stamp_s, x, y, yaw_rad = pose
        if texts.findings:
            self._note_texts(findings)
        path = destinations = NO_PATH
        if texts.destinations:
            points = _points(texts.destinations, rows, marks[OF_DESTINATIONS:], ends_s[2:], findings)
            destinations = path_points.checked_destinations(points, len(points.datums), stamp_s, findings)
        if texts.path:
            points = _points(texts.path, rows, marks[OF_PATH:], ends_s[:2], findings)
            path = path_points.checked_path(points, len(points.datums), stamp_s, findings)
        is_driving = not texts.known_state and not isnan(linear_mps)
        return Status(
            uuid,
            stamp_s,
            self.stamp_resolution_s,
            vocabulary.by_motion(texts.state, linear_mps) if is_driving else texts.state,
            texts.known_state,
            x,
            y,
            z,
            yaw_rad,
            texts.datum,
            None if isnan(linear_mps) else linear_mps,
            None if isnan(turn_rad) else turn_rad,
            self.amounts,
            (),
            destinations,
            path,
            tuple(findings),
            oddities=tuple(findings.oddities),
        )

    def _note_texts(self, findings: Findings) -> None:
        """Note the deviations of stamp, state and datum, in this order."""
        texts = self.texts
        first = texts.findings[0]
        if first in _STAMP_FINDINGS[1] or first in _STAMP_FINDINGS[2]:
            findings.note(first, "timestamp", _STAMPED.decode(self.raw).timestamp, write(self.stamp_s))
        findings.update(dict.fromkeys(texts.findings))
        findings.name(texts.oddities)


def scan(raw: bytes) -> ScannedStatus | None:
    """The status of a message. None if it is not a plain status."""
    most_points = min(len(raw) // LEAST_POINT_LENGTH, path_points.MOST_POINTS_USED)
    rows, marks = np.empty((HEAD_ROWS + most_points, 4)), np.empty(MARKS, np.int64)
    if not read_status(raw, rows, marks):
        return None
    at = marks.tolist()
    _, _, state, state_end, _, deviation, place_uuid, place_uuid_end, place, place_end = at[:OF_PATH]
    _, _, path_uuid, path_uuid_end, path, path_end, path_deviation = at[OF_PATH:OF_DESTINATIONS]
    _, _, stops_uuid, stops_uuid_end, stops, stops_end, stops_deviation = at[OF_DESTINATIONS:]
    texts = _texts(
        raw[state:state_end],
        deviation,
        raw[place:place_end] if place >= 0 else None,
        raw[place_uuid:place_uuid_end] if place_uuid >= 0 else None,
        path_deviation,
        raw[path_uuid:path_uuid_end] if path_uuid >= 0 else None,
        raw[path:path_end] if path >= 0 else None,
        stops_deviation,
        raw[stops_uuid:stops_uuid_end] if stops_uuid >= 0 else None,
        raw[stops:stops_end] if stops >= 0 else None,
    )
    return ScannedStatus(raw, rows, at, texts)


def _points(texts: PointTexts, rows: Floats, marks: Sequence[int], ends_s: Sequence[float], findings: Findings) -> Path:
    """The points, at least one, in the rows from `marks[0]` to `marks[1]`."""
    datum, of_texts = texts
    begin, end = marks[:2]
    if of_texts:
        findings.update(dict.fromkeys(of_texts))
    return Path(tuple(map(tuple, rows[begin:end].tolist())), (datum,) * (end - begin), True, (ends_s[0], ends_s[1]))


@lru_cache(_CACHED)
def _texts(
    state: bytes,
    stamp_deviation: int,
    datum: bytes | None,
    misplaced_datum: bytes | None,
    path_deviation: int,
    path_datum: bytes | None,
    misplaced_path_datum: bytes | None,
    destinations_deviation: int,
    destinations_datum: bytes | None,
    misplaced_destinations_datum: bytes | None,
) -> StatusTexts:
    """The meaning of texts as they were sent. A misplaced datum is under the key of the other kind of location.

    Deviations are those of stamps; negative if there are no points.
    """
    findings = Findings(_STAMP_FINDINGS[stamp_deviation])
    name, known = vocabulary.state(state.decode(), findings)
    place = vocabulary.datum(
        _decoded(datum), _decoded(misplaced_datum), findings, empty="datum-missing", path=DATUM_PATH
    )
    path = destinations = None
    if path_deviation >= 0:
        path = _point_texts(path_deviation, path_datum, misplaced_path_datum)
    if destinations_deviation >= 0:
        destinations = _point_texts(destinations_deviation, destinations_datum, misplaced_destinations_datum)
    return StatusTexts(name, known, place, tuple(findings), tuple(findings.oddities), path, destinations)


@lru_cache(_CACHED)
def _point_texts(deviation: int, datum: bytes | None, misplaced_datum: bytes | None) -> PointTexts:
    findings = Findings(_STAMP_FINDINGS[deviation])
    return path_points.datum(_decoded(datum), _decoded(misplaced_datum), findings), tuple(findings)


def _decoded(text: bytes | None) -> str | None:
    return None if text is None else text.decode()
