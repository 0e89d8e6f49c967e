"""Reads a plain status from its bytes with `scanner_kernels`.

`ingest/languages/massrobotics/parser.py` reads the same from it, but slower.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import isnan

import msgspec
import numpy as np

from ingest.batch import Floats
from ingest.fast_path.scanner_kernels import (
    HEAD_ROWS,
    LEAST_LETTERS,
    MARKS,
    MOST,
    OF_DESTINATIONS,
    OF_PATH,
    read_status,
)
from ingest.languages.massrobotics import path_points, vocabulary
from ingest.languages.massrobotics.amounts import HOUR_S
from ingest.languages.massrobotics.conformance_rules import Findings, RejectedError
from ingest.languages.massrobotics.parser import rejection
from ingest.languages.massrobotics.timestamps import digit_resolution_s
from ingest.languages.model import NO_PATH, Path, Rejection, Status

_OF_STAMPS = (), ("stamp-no-offset",), ("stamp-offset-no-colon",)
"""Findings, by how a stamp departs."""
_RESOLUTIONS_S = [digit_resolution_s(digits) for digits in range(10)]
_REMEMBERED = 1024
"""Combinations of texts that are kept: robots send the same few again and again."""


class StatusTexts(msgspec.Struct, frozen=True, gc=False, eq=False):
    """What the texts of a status mean, except its UUID. Statuses with the same texts share one object."""

    state: str
    known_state: bool
    datum: str
    found: tuple[str, ...]
    """Findings on its stamp and on these."""
    path: tuple[str, tuple[str, ...]] | None
    """The datum, and the findings on stamps and datum; None where there are no points."""
    destinations: tuple[str, tuple[str, ...]] | None


class ScannedStatus(msgspec.Struct, frozen=True, gc=False, eq=False):
    """A plain status whose bytes were scanned."""

    raw: bytes
    rows: Floats
    """(r, 4) numbers, as `ingest/fast_path/scanner_kernels.py` has them."""
    at: list[int]
    """Where things are, as it marks them."""
    texts: StatusTexts

    @property
    def uuid(self) -> bytes:
        """As it was sent."""
        return self.raw[self.at[0] : self.at[1]]

    @property
    def stamp_s(self) -> float:
        return self.rows.item(0)

    @property
    def stamp_resolution_s(self) -> float:
        return _RESOLUTIONS_S[self.at[4]]

    def message(self, names_as_uuid: str | None) -> Status | Rejection:
        """The status, or a rejection where its UUID can't be read."""
        findings: Findings = {}
        try:
            uuid = vocabulary.robot_uuid(self.uuid.decode(), names_as_uuid, findings)
        except RejectedError as rejected:
            return rejection(rejected, self.uuid.decode(), names_as_uuid, findings)
        return self._status(uuid, findings)

    def _status(self, uuid: str, findings: Findings) -> Status:
        rows, at, texts = self.rows, self.at, self.texts
        pose, (z, linear_mps, turn_rad, _), (battery_pct, run_time_left_h, available_pct, _), ends_s = rows[
            :HEAD_ROWS
        ].tolist()
        stamp_s, x, y, yaw_rad = pose
        if texts.found:
            findings.update(dict.fromkeys(texts.found))
        path = destinations = NO_PATH
        if texts.destinations:
            read = _path(texts.destinations, rows, at[OF_DESTINATIONS:], ends_s[2:], findings)
            destinations = path_points.checked_destinations(read, len(read.datums), stamp_s, findings)
        if texts.path:
            read = _path(texts.path, rows, at[OF_PATH:], ends_s[:2], findings)
            path = path_points.checked_path(read, len(read.datums), stamp_s, findings)
        return Status(
            uuid,
            stamp_s,
            self.stamp_resolution_s,
            texts.state,
            texts.known_state,
            x,
            y,
            z,
            yaw_rad,
            texts.datum,
            None if isnan(linear_mps) else linear_mps,
            None if isnan(turn_rad) else turn_rad,
            None if isnan(available_pct) else 100.0 - available_pct,
            None if isnan(battery_pct) else battery_pct,
            None if isnan(run_time_left_h) else run_time_left_h * HOUR_S,
            (),
            destinations,
            path,
            tuple(findings),
        )


def scan(raw: bytes) -> ScannedStatus | None:
    """A status that is plain; None for any other message."""
    rows, marks = np.empty((HEAD_ROWS + min(len(raw) // LEAST_LETTERS, MOST), 4)), np.empty(MARKS, np.int64)
    if not read_status(raw, rows, marks):
        return None
    at = marks.tolist()
    texts = _texts(
        raw[at[2] : at[3]],
        at[5],
        raw[at[8] : at[9]] if at[8] >= 0 else None,
        raw[at[6] : at[7]] if at[6] >= 0 else None,
        at[16],
        raw[at[12] : at[13]] if at[12] >= 0 else None,
        raw[at[14] : at[15]] if at[14] >= 0 else None,
        at[23],
        raw[at[19] : at[20]] if at[19] >= 0 else None,
        raw[at[21] : at[22]] if at[21] >= 0 else None,
    )
    return ScannedStatus(raw, rows, at, texts)


def _path(
    said: tuple[str, tuple[str, ...]], rows: Floats, at: Sequence[int], ends_s: Sequence[float], findings: Findings
) -> Path:
    """The points from the first row of `at` to the second, at least one, with what their words say."""
    datum, found = said
    begin, end = at[:2]
    if found:
        findings.update(dict.fromkeys(found))
    return Path(tuple(map(tuple, rows[begin:end].tolist())), (datum,) * (end - begin), True, (ends_s[0], ends_s[1]))


@lru_cache(_REMEMBERED)
def _texts(
    state: bytes,
    departs: int,
    right: bytes | None,
    other: bytes | None,
    path_departs: int,
    path_right: bytes | None,
    path_other: bytes | None,
    destinations_depart: int,
    destinations_right: bytes | None,
    destinations_other: bytes | None,
) -> StatusTexts:
    """Of times that depart so, negative where there are no points, and such a state and datums."""
    findings: Findings = dict.fromkeys(_OF_STAMPS[departs])
    name, known = vocabulary.state(state.decode(), findings)
    datum = vocabulary.datum(_decoded(right), _decoded(other), findings, empty="datum-missing")
    path = destinations = None
    if path_departs >= 0:
        path = _datum_of_points(path_departs, path_right, path_other)
    if destinations_depart >= 0:
        destinations = _datum_of_points(destinations_depart, destinations_right, destinations_other)
    return StatusTexts(name, known, datum, tuple(findings), path, destinations)


@lru_cache(_REMEMBERED)
def _datum_of_points(departs: int, right: bytes | None, other: bytes | None) -> tuple[str, tuple[str, ...]]:
    """The datum of points, with the findings on their stamps and on that."""
    findings: Findings = dict.fromkeys(_OF_STAMPS[departs])
    return path_points.datum(_decoded(right), _decoded(other), findings), tuple(findings)


def _decoded(letters: bytes | None) -> str | None:
    return None if letters is None else letters.decode()
