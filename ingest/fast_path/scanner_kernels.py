"""The letters of a status, or of the points of a path alone, to numbers and places, compiled.

Left to others is whatever is not the plain case: text that is not ASCII, escapes, other keys, keys twice, error codes,
points on several datums, unknown or odd headings, times out of order or with an offset from UTC, numbers out of their
range, and those of more digits than can be had exactly here.

A number of up to 18 digits is the double nearest to it: digits below 2**53 over a power of ten up to 10**22 are both
exact, so that one division rounds once (Clinger 1990, How to read floating point numbers accurately); of more digits
the quotient is worked out to 55 bits and rounded to even.
"""

from math import atan2, inf, ldexp, nan
from typing import Any

import numpy as np
from numba import types

from ingest.batch import Floats, Ints
from ingest.kernels import inner, kernel

MOST, LEAST_LETTERS = 200, 64
"""Points, of more none are read here; and letters of one."""
MOST_POSITION = 1e7
"""Metres, or degrees: beyond it a location is absurd."""
LATEST_US = 4102444800_000_000
"""2100; the earliest is 1970."""
MOST_SPEED, MOST_SHARE = 100.0, 100.0
"""Metres a second, per cent."""
MOST_LETTERS = 80
"""Of a word: what is made of it is remembered."""
NO_OFFSET, NO_COLON = 1, 2
"""How times depart from RFC 3339: no offset from UTC, or one without a colon."""
_TEN = np.array([float(10**power) for power in range(23)])
_WHOLE_TEN = 10 ** np.arange(19)
_EXACT = 1 << 53
_WORDS = (
    *("timestamp", "x", "y", "angle", "z", "planarDatumUUID", "planarDatum"),
    *("linear", "angular"),
    *("batteryPercentage", "remainingRunTime", "loadPercentageStillAvailable"),
    *("uuid", "operationalState", "timestamp", "location", "velocity", "errorCodes", "path", "destinations"),
)
"""The keys of a point, the first four of which are its row, of a velocity, and of a status."""
_TIMESTAMP, _ANGLE, _Z, _RIGHT, _LINEAR, _BATTERY, _HOURS, _UUID = 0, 3, 4, 5, 7, 9, 10, 12
_STATE, _STAMPED, _LOCATION, _VELOCITY, _ERRORS, _PATH = range(_UUID + 1, len(_WORDS) - 1)
_LETTERS = np.frombuffer("".join(_WORDS).encode(), np.uint8)
_BEGINS = np.cumsum([0, *map(len, _WORDS)])
"""Of each key in `_LETTERS`."""
_PLACED, _TIMED = 0b1110, 0b1111
"""The keys that a location needs, and a point, as bits."""
_NEEDED = 1 << _UUID | 1 << _STATE | 1 << _STAMPED | 1 << _LOCATION
HEAD_ROWS = 4
"""Rows of a status before its points: its stamp and pose; height, speed and turn; battery, hours left and load;
the first and last times of its path and of its destinations."""
OF_LOCATION, OF_PATH, OF_DESTINATIONS, MARKS = 6, 10, 17, 24
"""Marks of a status: where its UUID and state begin and end, how many digits its stamp has and how it departs; what its
location tells; and of path and destinations where their rows begin and end, and what they tell, -1 where there are
none."""
_BEFORE_MONTH = np.cumsum([0, 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30])
_LETTERS_OF = types.CPointer(types.uint8)  # type: ignore[no-untyped-call]
_TEXT = types.Bytes(types.uint8, 1, "C", readonly=True)
_ROWS, _PLACES = types.float64[:, ::1], types.int64[::1]
_COUNTED = types.Tuple((types.int64, types.UniTuple(types.int64, 5)))  # type: ignore[no-untyped-call]
Told = tuple[int, int, int, int, int]
"""Of a point, where the texts of its datums begin and end, -1 for none, and how its time departs."""
NOTHING = (-1, -1, -1, -1, 0)

Letters = Any
"""A pointer to bytes."""


@inner
def _after_space(text: Letters, end: int, at: int) -> int:
    while at < end and (text[at] == 32 or text[at] == 10 or text[at] == 13 or text[at] == 9):
        at += 1
    return at


@inner
def _after(text: Letters, end: int, at: int, letter: int) -> int:
    """Behind `letter` and the space around it; -1 where something else stands there, or `at` is -1."""
    if at < 0:
        return -1
    at = _after_space(text, end, at)
    return _after_space(text, end, at + 1) if at < end and text[at] == letter else -1


@inner
def _end_of_text(text: Letters, end: int, at: int) -> int:
    """Where the text that begins at `at` ends, its closing quote; -1 where it is not plain."""
    while at < end and text[at] != 34:
        if text[at] < 32 or text[at] > 126 or text[at] == 92:
            return -1
        at += 1
    return at if at < end else -1


@inner
def _divided(digits: int, by: int) -> float:
    """The double nearest to a quotient of whole numbers, `digits` from 2**53 to 10**18, `by` up to 10**18."""
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
def _number(text: Letters, end: int, at: int) -> tuple[int, float]:
    """Where a number ends, and the number; -1 where it is left to others."""
    minus = at < end and text[at] == 45
    at += minus
    digits, decimals, begin, point = 0, 0, at, -1
    while at < end:
        letter = text[at]
        if 48 <= letter <= 57:
            if digits >= 10**17:
                return -1, 0.0
            digits = digits * 10 + (letter - 48)
            decimals += point >= 0
        elif letter == 46 and point < 0:
            point = at
        else:
            break
        at += 1
    whole = (at if point < 0 else point) - begin
    if whole < 1 or (whole > 1 and text[begin] == 48) or (point >= 0 and decimals < 1) or decimals > 22:
        return -1, 0.0
    if at < end and (text[at] == 69 or text[at] == 101):
        return -1, 0.0
    if digits <= _EXACT:
        if digits == 0 and minus and point < 0:
            return -1, 0.0
        value = digits / _TEN[decimals]
    elif 0 < decimals <= 18 and digits // _WHOLE_TEN[decimals] < _EXACT:
        value = _divided(digits, _WHOLE_TEN[decimals])
    else:
        return -1, 0.0
    return at, -value if minus else value


@inner
def _two(text: Letters, at: int) -> int:
    """A number of two digits; -1000 where there are none."""
    tens, ones = text[at] - 48, text[at + 1] - 48
    return tens * 10 + ones if 0 <= tens <= 9 and 0 <= ones <= 9 else -1000


@inner
def _day(text: Letters, at: int) -> int:
    """Days since 1970 of a date; -1 where it is none from then on."""
    year, month, day = (
        _two(text, at) * 100 + _two(text, at + 2),
        _two(text, at + 5),
        _two(text, at + 8),
    )
    if year < 1970 or month < 1 or month > 12 or day < 1 or text[at + 4] != 45 or text[at + 7] != 45:
        return -1
    leap = year % 4 == 0 and (year % 100 != 0 or year % 400 == 0)
    before = _BEFORE_MONTH[month - 1] + (leap and month > 2)
    length = 31 if month == 12 else _BEFORE_MONTH[month] + (leap and month > 1) - before
    leaps = (year - 1) // 4 - (year - 1) // 100 + (year - 1) // 400 - 477
    return (year - 1970) * 365 + leaps + before + day - 1 if day <= length else -1


@inner
def _zero_offset(text: Letters, end: int, at: int) -> tuple[int, int]:
    """Where an offset from UTC of nothing ends, a quote, and how it is spelt; -1 where something else stands there."""
    departs = NO_OFFSET
    if at < end and text[at] == 90:
        at, departs = at + 1, 0
    elif at + 5 < end and text[at] == 43:
        colon = text[at + 3] == 58
        if _two(text, at + 1) != 0 or _two(text, at + 3 + colon) != 0:
            return -1, 0
        at, departs = at + 5 + colon, 0 if colon else NO_COLON
    return (at, departs) if at < end and text[at] == 34 else (-1, 0)


@inner
def _stamp(text: Letters, end: int, at: int) -> tuple[int, float, int, int]:
    """Behind the closing quote of a time, -1 where it is left to others; seconds since 1970, digits of a fraction of
    one, and how it departs."""
    if at + 21 > end or text[at + 10] != 84 or text[at + 13] != 58 or text[at + 16] != 58:
        return -1, 0.0, 0, 0
    day, hour, minute, second = (
        _day(text, at),
        _two(text, at + 11),
        _two(text, at + 14),
        _two(text, at + 17),
    )
    if day < 0 or not (0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 60):
        return -1, 0.0, 0, 0
    us, at, worth, digits = (((day * 24 + hour) * 60 + minute) * 60 + second) * 1_000_000, at + 19, 100_000, 0
    if text[at] == 46:
        begin = at + 1
        at = begin
        while at < end and 48 <= text[at] <= 57:
            us, worth, at = us + (text[at] - 48) * worth, worth // 10, at + 1
        digits = at - begin
        if not 1 <= digits <= 9:
            return -1, 0.0, 0, 0
    if us > LATEST_US:
        return -1, 0.0, 0, 0
    at, departs = _zero_offset(text, end, at)
    return at + (at >= 0), us / 1_000_000, digits, departs


@inner
def _angle(text: Letters, end: int, at: int) -> tuple[int, float]:
    """Where a unit quaternion ends, and the rotation about the vertical, as `paths.yaw_rad` has it."""
    x = y = z = w = 0.0
    seen = 0
    at = _after(text, end, at, 123)
    while at >= 0:
        part = text[at + 1] if at + 2 < end and text[at] == 34 and text[at + 2] == 34 else 0
        at = _after(text, end, at + 3, 58)
        if not (part == 119 or 120 <= part <= 122) or at < 0:
            return -1, 0.0
        at, value = _number(text, end, at)
        if seen & 1 << (part - 119) or at < 0:
            return -1, 0.0
        seen |= 1 << (part - 119)
        if part == 120:
            x = value
        elif part == 121:
            y = value
        elif part == 122:
            z = value
        else:
            w = value
        ends = _after(text, end, at, 125)
        if ends >= 0:
            square_x, square_y, square_z, square_w = x * x, y * y, z * z, w * w
            if seen != 15 or not 0.99 < square_x + square_y + square_z + square_w < 1.01:
                return -1, 0.0
            return ends, atan2(2.0 * (w * z + x * y), square_w + square_x - square_y - square_z)
        at = _after(text, end, at, 44)
    return -1, 0.0


@inner
def _key(text: Letters, end: int, at: int, first: int, last: int) -> tuple[int, int]:
    """Which key of `_WORDS`, from `first` to `last`, stands there and where its value begins; -1 where none does."""
    for which in range(first, last + 1):
        begin, quote = _BEGINS[which], at + 1 + _BEGINS[which + 1] - _BEGINS[which]
        if quote < end and text[at] == 34 and text[quote] == 34:
            i = at + 1
            while i < quote and text[i] == _LETTERS[begin + i - at - 1]:
                i += 1
            if i == quote:
                return which, _after(text, end, quote + 1, 58)
    return 0, -1


@inner
def _datum(text: Letters, end: int, at: int, first: int, first_end: int) -> tuple[int, int, int]:
    """Where the text that begins at `at` is told to stand, and where what follows it begins, -1 if it is not plain."""
    if _again(text, end, at, first, first_end):
        return first, first_end, at + first_end - first + 1
    quote = _end_of_text(text, end, at)
    return at, quote, quote + 1 if 0 <= quote <= at + MOST_LETTERS else -1


@inner
def _again(text: Letters, end: int, at: int, first: int, first_end: int) -> bool:
    """Whether the text between `first` and `first_end`, if any, stands at `at` too, and a quote behind it."""
    quote = at + first_end - first
    if first < 0 or quote >= end or text[quote] != 34:
        return False
    for i in range(first_end - first):  # noqa: SIM110 - compiled
        if text[at + i] != text[first + i]:
            return False
    return True


@inner
def _point(
    text: Letters, end: int, at: int, rows: Floats, row: int, needed: int, first: Told
) -> tuple[int, float, Told]:
    """Where a point ends that begins at `at`, -1 where it is left to others; its height, and what it tells.

    Fills `row` but for what is not `needed`. What it tells as `first` does is told to stand where it stands there.
    """
    at, seen, z, departs = _after(text, end, at, 123), 0, 0.0, 0
    right, right_end, other, other_end = NOTHING[0], NOTHING[1], NOTHING[2], NOTHING[3]
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
        elif text[at] != 34:
            break
        elif key == _TIMESTAMP:
            at, rows[row, _TIMESTAMP], _, departs = _stamp(text, end, at + 1)
        elif key == _RIGHT:
            right, right_end, at = _datum(text, end, at + 1, first[0], first[1])
        else:
            other, other_end, at = _datum(text, end, at + 1, first[2], first[3])
        ends = _after(text, end, at, 125)
        if ends >= 0:
            near = abs(rows[row, 1]) <= MOST_POSITION and abs(rows[row, 2]) <= MOST_POSITION
            if not (near and abs(z) <= MOST_POSITION and seen & _TIMED == needed):
                break
            return ends, z, (right, right_end, other, other_end, departs)
        at = _after(text, end, at, 44)
    return -1, 0.0, NOTHING


@inner
def _array(text: Letters, end: int, at: int, rows: Floats, begin: int) -> tuple[int, int, Told]:
    """Where an array of points ends that begins at `at`, -1 where it is left to others; and what all of them tell.

    Between the two the row behind its last one: it has those from `begin`.
    """
    at, row, first = _after(text, end, at, 91), begin, NOTHING
    ends = _after(text, end, at, 93)
    while at >= 0 and ends < 0 and row < len(rows):
        at, _, told = _point(text, end, at, rows, row, _TIMED, first)
        if row == begin:
            first = told
        if at < 0 or told != first or (row > begin and rows[row, 0] <= rows[row - 1, 0]):
            break
        row += 1
        ends = _after(text, end, at, 93)
        at = _after(text, end, at, 44)
    return ends, row, first


@inner
def _velocity(text: Letters, end: int, at: int, rows: Floats) -> int:
    """Where a velocity ends that begins at `at`, -1 where it is left to others. Fills two places of row 1."""
    at, seen = _after(text, end, at, 123), 0
    while at >= 0:
        key, at = _key(text, end, at, _LINEAR, _LINEAR + 1)
        if at < 0 or seen & 1 << key:
            break
        seen |= 1 << key
        if key == _LINEAR:
            at, rows[1, 1] = _number(text, end, at)
            if not abs(rows[1, 1]) <= MOST_SPEED:
                break
        else:
            at, rows[1, 2] = _angle(text, end, at)
        ends = _after(text, end, at, 125)
        if ends >= 0:
            return ends if seen & 1 << _LINEAR else -1
        at = _after(text, end, at, 44)
    return -1


@inner
def _part(text: Letters, end: int, at: int, key: int, rows: Floats, marks: Ints) -> int:
    """Where the value of a status's `key` ends that begins at `at`, -1 where it is left to others; into the others."""
    if key < _UUID:
        at, number = _number(text, end, at)
        if not 0.0 <= number <= (inf if key == _HOURS else MOST_SHARE) or (key == _BATTERY and 0.0 < number < 1.0):
            return -1
        rows[2, key - _BATTERY] = number
    elif key < _LOCATION:
        if text[at] != 34:
            return -1
        if key == _STAMPED:
            at, rows[0, 0], marks[4], marks[5] = _stamp(text, end, at + 1)
            return at
        mark = (key - _UUID) * 2
        marks[mark], marks[mark + 1], at = _datum(text, end, at + 1, -1, -1)
    elif key == _LOCATION:
        at, rows[1, 0], (marks[6], marks[7], marks[8], marks[9], _) = _point(text, end, at, rows, 0, _PLACED, NOTHING)
    elif key == _VELOCITY:
        at = _velocity(text, end, at, rows)
    elif key == _ERRORS:
        at = _after(text, end, _after(text, end, at, 91), 93)
    else:
        begin, mark = max(HEAD_ROWS, marks[OF_PATH + 1], marks[OF_DESTINATIONS + 1]), OF_PATH
        if key != _PATH:
            mark = OF_DESTINATIONS
        at, behind, told = _array(text, end, at, rows, begin)
        if behind > begin:
            ends = 0 if key == _PATH else 2
            rows[3, ends], rows[3, ends + 1] = rows[begin, 0], rows[behind - 1, 0]
            marks[mark], marks[mark + 1] = begin, behind
            for i in range(5):
                marks[mark + 2 + i] = told[i]
    return at


@kernel(types.boolean(_LETTERS_OF, types.int64, _ROWS, _PLACES))
def _whole_status(text: Letters, end: int, rows: Floats, marks: Ints) -> bool:
    """Whether a status is not left to others; into `rows` and `marks`."""
    at, seen = _after(text, end, 0, 123), 0
    rows[1:HEAD_ROWS] = nan
    marks[:] = -1
    while at >= 0:
        key, at = _key(text, end, at, _BATTERY, len(_WORDS) - 1)
        if at < 0 or at >= end or seen & 1 << key:
            break
        seen |= 1 << key
        at = _part(text, end, at, key, rows, marks)
        ends = _after(text, end, at, 125)
        if ends >= 0:
            return ends == end and seen & _NEEDED == _NEEDED
        at = _after(text, end, at, 44)
    return False


@kernel(types.boolean(_TEXT, _ROWS, _PLACES))
def read_status(text: bytes, rows: Floats, marks: Ints) -> bool:
    """`_whole_status`, which counts no references, since it is handed the letters alone."""
    return _whole_status(np.frombuffer(text, np.uint8).ctypes, len(text), rows, marks)
