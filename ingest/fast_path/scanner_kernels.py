"""Scans the bytes of a plain status for its numbers and the positions of its texts, compiled.

A status is plain if it has none of these: text that is not ASCII, escapes, unknown keys, repeated keys, error codes,
points on several datums, a missing or odd heading, times out of order or with an offset from UTC, numbers out of range,
and numbers with more digits than can be converted exactly here. The parser reads statuses that are not plain.

A number of up to 18 digits becomes the nearest double. Digits below 2**53 and a power of ten up to 10**22 are both
exact, so one division rounds once (Clinger 1990, How to read floating point numbers accurately). With more digits the
quotient is computed to 55 bits and rounded to even.

The file is long because it holds all parts of one compiled scanner: keys, texts, numbers, times, points and the status.
Each part reads on where the part before it ended, so they share the position in the text, the rows and the marks.
"""

from math import atan2, inf, ldexp, nan
from typing import Any

import numpy as np
from numba import types

from ingest.batch import Floats, Ints
from ingest.kernels import inner, kernel
from ingest.languages.massrobotics.vocabulary import MAX_WORD
from ingest.languages.model import MAX_POSITION, MAX_SPEED_MPS
from ingest.languages.timestamps import LATEST_S

LEAST_POINT_LENGTH = 64
"""Characters that a point has at least."""
LATEST_US = int(LATEST_S) * 1_000_000
MAX_PERCENTAGE = 100.0
NO_OFFSET, NO_COLON = 1, 2
"""Deviations of a time from RFC 3339: no offset from UTC, or an offset without a colon. 0 is none."""

_QUOTE, _COLON, _COMMA, _MINUS, _POINT, _PLUS = 34, 58, 44, 45, 46, 43
_OPEN_BRACE, _CLOSE_BRACE, _OPEN_BRACKET, _CLOSE_BRACKET, _BACKSLASH = 123, 125, 91, 93, 92
_ZERO, _NINE, _UPPER_E, _LOWER_E, _UPPER_T, _UPPER_Z, _LOWER_W, _LOWER_X = 48, 57, 69, 101, 84, 90, 119, 120
_SPACE, _NEWLINE, _RETURN, _TAB, _LAST_PRINTABLE = 32, 10, 13, 9, 126
"""Codes of ASCII characters."""

_POWERS_OF_TEN = np.array([float(10**power) for power in range(23)])
_WHOLE_POWERS_OF_TEN = 10 ** np.arange(19)
_EXACT = 1 << 53
_KEYS = (
    *("timestamp", "x", "y", "angle", "z", "planarDatumUUID", "planarDatum"),
    *("linear", "angular"),
    *("batteryPercentage", "remainingRunTime", "loadPercentageStillAvailable"),
    *("uuid", "operationalState", "timestamp", "location", "velocity", "errorCodes", "path", "destinations"),
)
"""The keys of a point, the first four of which are its row, then those of a velocity, then those of a status."""
_TIMESTAMP, _ANGLE, _Z, _DATUM_UUID, _LINEAR, _BATTERY, _RUN_TIME, _UUID = 0, 3, 4, 5, 7, 9, 10, 12
_STATE, _STATUS_TIMESTAMP, _LOCATION, _VELOCITY, _ERRORS, _PATH = range(_UUID + 1, len(_KEYS) - 1)
"""Indices of keys."""
_KEY_TEXT = np.frombuffer("".join(_KEYS).encode(), np.uint8)
_KEY_BEGINS = np.cumsum([0, *map(len, _KEYS)])
"""Where each key begins in `_KEY_TEXT`."""
_LOCATION_KEYS, _POINT_KEYS = 0b1110, 0b1111
"""The keys that a location and a point need, as bits."""
_STATUS_KEYS = 1 << _UUID | 1 << _STATE | 1 << _STATUS_TIMESTAMP | 1 << _LOCATION
"""The keys that a status needs, as bits."""
HEAD_ROWS = 4
"""Rows of a status before those of its points. Each has four places:

0. stamp, x, y and yaw
1. height, speed, turn in one second, unused
2. battery, hours of run time left, load still available, unused
3. first and last time of the path, first and last time of the destinations
"""
AMOUNTS_ROW = 2
UUID_BEGIN, UUID_END, STATE_BEGIN, STATE_END, STAMP_DIGITS, STAMP_DEVIATION = range(6)
OF_LOCATION, OF_PATH, OF_DESTINATIONS, MARKS = 6, 10, 17, 24
"""Marks of a status, -1 for what it does not have:

- where its UUID and its state begin and end, the digits of a second in its stamp, and the deviation of its stamp
- from `OF_LOCATION` on: where its `planarDatumUUID` and its `planarDatum` begin and end
- from `OF_PATH` and from `OF_DESTINATIONS` on: the first row and the end of the points, and their `PointMarks`
"""
PointMarks = tuple[int, int, int, int, int]
"""Where the `planarDatumUUID` and `planarDatum` of a point begin and end, -1 for none; the deviation of its time."""
NO_MARKS = (-1, -1, -1, -1, 0)
_DAYS_BEFORE_MONTH = np.cumsum([0, 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30])
_TEXT_POINTER = types.CPointer(types.uint8)  # type: ignore[no-untyped-call]
_BYTES = types.Bytes(types.uint8, 1, "C", readonly=True)
_ROWS, _MARKS = types.float64[:, ::1], types.int64[::1]

Text = Any
"""A pointer to the bytes of a message. In all functions `end` is its length and `at` a position in it."""


@inner
def _skip_space(text: Text, end: int, at: int) -> int:
    while at < end and (text[at] == _SPACE or text[at] == _NEWLINE or text[at] == _RETURN or text[at] == _TAB):
        at += 1
    return at


@inner
def _skip(text: Text, end: int, at: int, character: int) -> int:
    """The position behind `character` and the space around it. -1 if another one stands there or `at` is -1."""
    if at < 0:
        return -1
    at = _skip_space(text, end, at)
    return _skip_space(text, end, at + 1) if at < end and text[at] == character else -1


@inner
def _text_end(text: Text, end: int, at: int) -> int:
    """The position of the closing quote of a text that begins at `at`. -1 if the text is not plain."""
    while at < end and text[at] != _QUOTE:
        if text[at] < _SPACE or text[at] > _LAST_PRINTABLE or text[at] == _BACKSLASH:
            return -1
        at += 1
    return at if at < end else -1


@inner
def _nearest_quotient(digits: int, by: int) -> float:
    """The double nearest to `digits` / `by`, whole numbers: `digits` from 2**53 to 10**18, `by` up to 10**18."""
    whole, rest, shift = digits // by, digits % by, 0
    while whole < 1 << 54:
        whole, rest, shift = whole << 1, rest << 1, shift + 1
        if rest >= by:
            whole, rest = whole + 1, rest - by
    rounded, below = whole >> 2, (whole & 3) * 2 + (rest > 0)
    if below > 4 or (below == 4 and rounded & 1):
        rounded += 1
    return ldexp(float(rounded), 2 - shift)


@inner
def _number(text: Text, end: int, at: int) -> tuple[int, float]:
    """The end of a number, and the number. The end is -1 if it is not plain."""
    minus = at < end and text[at] == _MINUS
    at += minus
    digits, decimals, begin, point = 0, 0, at, -1
    while at < end:
        character = text[at]
        if _ZERO <= character <= _NINE:
            if digits >= 10**17:
                return -1, 0.0
            digits = digits * 10 + (character - _ZERO)
            decimals += point >= 0
        elif character == _POINT and point < 0:
            point = at
        else:
            break
        at += 1
    whole = (at if point < 0 else point) - begin
    if whole < 1 or (whole > 1 and text[begin] == _ZERO) or (point >= 0 and decimals < 1) or decimals > 22:
        return -1, 0.0
    if at < end and (text[at] == _UPPER_E or text[at] == _LOWER_E):
        return -1, 0.0
    if digits <= _EXACT:
        if digits == 0 and minus and point < 0:
            return -1, 0.0
        value = digits / _POWERS_OF_TEN[decimals]
    elif 0 < decimals <= 18 and digits // _WHOLE_POWERS_OF_TEN[decimals] < _EXACT:
        value = _nearest_quotient(digits, _WHOLE_POWERS_OF_TEN[decimals])
    else:
        return -1, 0.0
    return at, -value if minus else value


@inner
def _two_digits(text: Text, at: int) -> int:
    """A number of two digits. -1000 if there are none."""
    tens, ones = text[at] - _ZERO, text[at + 1] - _ZERO
    return tens * 10 + ones if 0 <= tens <= 9 and 0 <= ones <= 9 else -1000


@inner
def _days(text: Text, at: int) -> int:
    """The days from 1970 to a date. -1 if it is no date or an earlier one."""
    year, month, day = (
        _two_digits(text, at) * 100 + _two_digits(text, at + 2),
        _two_digits(text, at + 5),
        _two_digits(text, at + 8),
    )
    if year < 1970 or month < 1 or month > 12 or day < 1 or text[at + 4] != _MINUS or text[at + 7] != _MINUS:
        return -1
    leap = year % 4 == 0 and (year % 100 != 0 or year % 400 == 0)
    before = _DAYS_BEFORE_MONTH[month - 1] + (leap and month > 2)
    length = 31 if month == 12 else _DAYS_BEFORE_MONTH[month] + (leap and month > 1) - before
    leaps = (year - 1) // 4 - (year - 1) // 100 + (year - 1) // 400 - 477
    return (year - 1970) * 365 + leaps + before + day - 1 if day <= length else -1


@inner
def _utc_offset(text: Text, end: int, at: int) -> tuple[int, int]:
    """The end of an offset of zero from UTC, which is a quote, and its deviation. The end is -1 for any other text."""
    deviation = NO_OFFSET
    if at < end and text[at] == _UPPER_Z:
        at, deviation = at + 1, 0
    elif at + 5 < end and text[at] == _PLUS:
        colon = text[at + 3] == _COLON
        if _two_digits(text, at + 1) != 0 or _two_digits(text, at + 3 + colon) != 0:
            return -1, 0
        at, deviation = at + 5 + colon, 0 if colon else NO_COLON
    return (at, deviation) if at < end and text[at] == _QUOTE else (-1, 0)


@inner
def _stamp(text: Text, end: int, at: int) -> tuple[int, float, int, int]:
    """A time: the position behind its closing quote, seconds since 1970, digits of its fraction, and its deviation.

    The position is -1 if the time is not plain.
    """
    if at + 21 > end or text[at + 10] != _UPPER_T or text[at + 13] != _COLON or text[at + 16] != _COLON:
        return -1, 0.0, 0, 0
    day, hour, minute, second = (
        _days(text, at),
        _two_digits(text, at + 11),
        _two_digits(text, at + 14),
        _two_digits(text, at + 17),
    )
    if day < 0 or not (0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 60):
        return -1, 0.0, 0, 0
    us, at, worth, digits = (((day * 24 + hour) * 60 + minute) * 60 + second) * 1_000_000, at + 19, 100_000, 0
    if text[at] == _POINT:
        begin = at + 1
        at = begin
        while at < end and _ZERO <= text[at] <= _NINE:
            us, worth, at = us + (text[at] - _ZERO) * worth, worth // 10, at + 1
        digits = at - begin
        if not 1 <= digits <= 9:
            return -1, 0.0, 0, 0
    if us > LATEST_US:
        return -1, 0.0, 0, 0
    at, deviation = _utc_offset(text, end, at)
    return at + (at >= 0), us / 1_000_000, digits, deviation


@inner
def _angle(text: Text, end: int, at: int) -> tuple[int, float]:
    """The end of a unit quaternion, and its yaw, as `path_points.yaw_rad`. The end is -1 if it is not plain."""
    x = y = z = w = 0.0
    seen = 0
    at = _skip(text, end, at, _OPEN_BRACE)
    while at >= 0:
        part = text[at + 1] if at + 2 < end and text[at] == _QUOTE and text[at + 2] == _QUOTE else 0
        at = _skip(text, end, at + 3, _COLON)
        if not (_LOWER_W <= part <= _LOWER_X + 2) or at < 0:
            return -1, 0.0
        at, value = _number(text, end, at)
        if seen & 1 << (part - _LOWER_W) or at < 0:
            return -1, 0.0
        seen |= 1 << (part - _LOWER_W)
        if part == _LOWER_X:
            x = value
        elif part == _LOWER_X + 1:
            y = value
        elif part == _LOWER_X + 2:
            z = value
        else:
            w = value
        ends = _skip(text, end, at, _CLOSE_BRACE)
        if ends >= 0:
            square_x, square_y, square_z, square_w = x * x, y * y, z * z, w * w
            if seen != 15 or not 0.99 < square_x + square_y + square_z + square_w < 1.01:
                return -1, 0.0
            return ends, atan2(2.0 * (w * z + x * y), square_w + square_x - square_y - square_z)
        at = _skip(text, end, at, _COMMA)
    return -1, 0.0


@inner
def _key(text: Text, end: int, at: int, first: int, last: int) -> tuple[int, int]:
    """The index of the key at `at`, from `first` to `last`, and where its value begins: -1 for any other key."""
    for key in range(first, last + 1):
        begin, quote = _KEY_BEGINS[key], at + 1 + _KEY_BEGINS[key + 1] - _KEY_BEGINS[key]
        if quote < end and text[at] == _QUOTE and text[quote] == _QUOTE:
            i = at + 1
            while i < quote and text[i] == _KEY_TEXT[begin + i - at - 1]:
                i += 1
            if i == quote:
                return key, _skip(text, end, quote + 1, _COLON)
    return 0, -1


@inner
def _datum(text: Text, end: int, at: int, first: int, first_end: int) -> tuple[int, int, int]:
    """The begin and end of a text, and the position behind it, -1 if it is not plain.

    A text that repeats the one from `first` to `first_end` gets the begin and end of that one.
    """
    if _repeats(text, end, at, first, first_end):
        return first, first_end, at + first_end - first + 1
    quote = _text_end(text, end, at)
    return at, quote, quote + 1 if 0 <= quote <= at + MAX_WORD else -1


@inner
def _repeats(text: Text, end: int, at: int, first: int, first_end: int) -> bool:
    """Whether the text from `first` to `first_end`, if any, stands at `at` too, with a quote behind it."""
    quote = at + first_end - first
    if first < 0 or quote >= end or text[quote] != _QUOTE:
        return False
    for i in range(first_end - first):  # noqa: SIM110 - compiled
        if text[at + i] != text[first + i]:
            return False
    return True


@inner
def _point(
    text: Text, end: int, at: int, rows: Floats, row: int, needed: int, first: PointMarks
) -> tuple[int, float, PointMarks]:
    """The end of a point, its height, and its marks. The end is -1 if the point is not plain.

    Writes the values of the `needed` keys into `rows[row]`. A text that repeats one of the point `first` gets its
    marks, so that points with equal texts have equal marks.
    """
    at, seen, z, deviation = _skip(text, end, at, _OPEN_BRACE), 0, 0.0, 0
    uuid, uuid_end, datum, datum_end = NO_MARKS[0], NO_MARKS[1], NO_MARKS[2], NO_MARKS[3]
    while at >= 0:
        key, at = _key(text, end, at, _TIMESTAMP, _LINEAR - 1)
        if at < 0 or at >= end or seen & 1 << key:
            break
        seen |= 1 << key
        if key == _ANGLE:
            at, rows[row, _ANGLE] = _angle(text, end, at)
        elif key == _Z:
            at, z = _number(text, end, at)
        elif _TIMESTAMP < key < _ANGLE:
            at, rows[row, key] = _number(text, end, at)
        elif text[at] != _QUOTE:
            break
        elif key == _TIMESTAMP:
            at, rows[row, _TIMESTAMP], _, deviation = _stamp(text, end, at + 1)
        elif key == _DATUM_UUID:
            uuid, uuid_end, at = _datum(text, end, at + 1, first[0], first[1])
        else:
            datum, datum_end, at = _datum(text, end, at + 1, first[2], first[3])
        ends = _skip(text, end, at, _CLOSE_BRACE)
        if ends >= 0:
            near = abs(rows[row, 1]) <= MAX_POSITION and abs(rows[row, 2]) <= MAX_POSITION
            if not (near and abs(z) <= MAX_POSITION and seen & _POINT_KEYS == needed):
                break
            return ends, z, (uuid, uuid_end, datum, datum_end, deviation)
        at = _skip(text, end, at, _COMMA)
    return -1, 0.0, NO_MARKS


@inner
def _points(text: Text, end: int, at: int, rows: Floats, begin: int) -> tuple[int, int, PointMarks]:
    """The end of an array of points, the row behind its last point, and the marks that all points share.

    The points are written from the row `begin` on. The end is -1 if the array is not plain.
    """
    at, row, first = _skip(text, end, at, _OPEN_BRACKET), begin, NO_MARKS
    ends = _skip(text, end, at, _CLOSE_BRACKET)
    while at >= 0 and ends < 0 and row < len(rows):
        at, _, marks = _point(text, end, at, rows, row, _POINT_KEYS, first)
        if row == begin:
            first = marks
        if at < 0 or marks != first or (row > begin and rows[row, 0] <= rows[row - 1, 0]):
            break
        row += 1
        ends = _skip(text, end, at, _CLOSE_BRACKET)
        at = _skip(text, end, at, _COMMA)
    return ends, row, first


@inner
def _velocity(text: Text, end: int, at: int, rows: Floats) -> int:
    """The end of a velocity, -1 if it is not plain. Writes speed and turn into row 1."""
    at, seen = _skip(text, end, at, _OPEN_BRACE), 0
    while at >= 0:
        key, at = _key(text, end, at, _LINEAR, _LINEAR + 1)
        if at < 0 or seen & 1 << key:
            break
        seen |= 1 << key
        if key == _LINEAR:
            at, rows[1, 1] = _number(text, end, at)
            if not abs(rows[1, 1]) <= MAX_SPEED_MPS:
                break
        else:
            at, rows[1, 2] = _angle(text, end, at)
        ends = _skip(text, end, at, _CLOSE_BRACE)
        if ends >= 0:
            return ends if seen & 1 << _LINEAR else -1
        at = _skip(text, end, at, _COMMA)
    return -1


@inner
def _status_value(text: Text, end: int, at: int, key: int, rows: Floats, marks: Ints) -> int:
    """The end of the value of a status's `key`, -1 if it is not plain. Writes the value into `rows` and `marks`."""
    if key < _UUID:
        at, number = _number(text, end, at)
        most = inf if key == _RUN_TIME else MAX_PERCENTAGE
        if not 0.0 <= number <= most or (key == _BATTERY and 0.0 < number < 1.0):
            return -1
        rows[2, key - _BATTERY] = number
    elif key < _LOCATION:
        if text[at] != _QUOTE:
            return -1
        if key == _STATUS_TIMESTAMP:
            at, rows[0, 0], marks[STAMP_DIGITS], marks[STAMP_DEVIATION] = _stamp(text, end, at + 1)
            return at
        mark = UUID_BEGIN if key == _UUID else STATE_BEGIN
        marks[mark], marks[mark + 1], at = _datum(text, end, at + 1, -1, -1)
    elif key == _LOCATION:
        at, rows[1, 0], (marks[6], marks[7], marks[8], marks[9], _) = _point(
            text, end, at, rows, 0, _LOCATION_KEYS, NO_MARKS
        )
    elif key == _VELOCITY:
        at = _velocity(text, end, at, rows)
    elif key == _ERRORS:
        at = _skip(text, end, _skip(text, end, at, _OPEN_BRACKET), _CLOSE_BRACKET)
    else:
        begin, mark = max(HEAD_ROWS, marks[OF_PATH + 1], marks[OF_DESTINATIONS + 1]), OF_PATH
        if key != _PATH:
            mark = OF_DESTINATIONS
        at, behind, shared = _points(text, end, at, rows, begin)
        if behind > begin:
            ends = 0 if key == _PATH else 2
            rows[3, ends], rows[3, ends + 1] = rows[begin, 0], rows[behind - 1, 0]
            marks[mark], marks[mark + 1] = begin, behind
            for i in range(5):
                marks[mark + 2 + i] = shared[i]
    return at


@kernel(types.boolean(_TEXT_POINTER, types.int64, _ROWS, _MARKS), for_kernels=True)
def _scan_status(text: Text, end: int, rows: Floats, marks: Ints) -> bool:
    """Whether a status is plain. Writes it into `rows` and `marks`."""
    at, seen = _skip(text, end, 0, _OPEN_BRACE), 0
    rows[1:HEAD_ROWS] = nan
    marks[:] = -1
    while at >= 0:
        key, at = _key(text, end, at, _BATTERY, len(_KEYS) - 1)
        if at < 0 or at >= end or seen & 1 << key:
            break
        seen |= 1 << key
        at = _status_value(text, end, at, key, rows, marks)
        ends = _skip(text, end, at, _CLOSE_BRACE)
        if ends >= 0:
            return ends == end and seen & _STATUS_KEYS == _STATUS_KEYS
        at = _skip(text, end, at, _COMMA)
    return False


@kernel(types.boolean(_BYTES, _ROWS, _MARKS))
def read_status(text: bytes, rows: Floats, marks: Ints) -> bool:
    """Whether a status is plain. Writes its numbers into `rows` and its positions into `marks`.

    `_scan_status` gets a pointer, so that it counts no references.
    """
    return _scan_status(np.frombuffer(text, np.uint8).ctypes, len(text), rows, marks)
