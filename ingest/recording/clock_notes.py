"""What the host's clock said while the service ran: a clock alone makes nothing old.

A clock that is a month ahead would make everything old at once. So ages count from the earliest time that the last
`HOURS` hours of running allow: what the clock said after each of them, and the time of running since. A clock that
jumps ahead adds no more than that to any age until the service has run for a day with it. It holds over restarts, and
time in which the service is off counts with the same delay.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from ingest.clocks import SteadyClock
from ingest.plain_files import read_file
from ingest.recording.replaced_file import replace_file, set_file_aside

FILE_NAME = "clock.json"
DAY_S, HOUR_S = 86_400.0, 3_600.0
HOURS = 24
LEAP_S = 3 * DAY_S
"""A clock that jumps by more, or a service that was off for longer, is a reason to look at the clock."""
NOTE_EVERY_S = 60.0
LATEST_S = 1e11
"""No clock says a later time."""

AnyTime = TypeVar("AnyTime", float, str)
"""Unix time, or RFC 3339."""

log = logging.getLogger(__name__)


class KnownTime(NamedTuple):
    """What is known of the present time."""

    sure_s: float
    """It is as late as this; 0 until that is known."""
    latest_s: float
    """The latest time that the clock said in the last day of running. Data of a later time has a wrong one."""

    def before_s(self, keep_days: float) -> float:
        """Data of an earlier time is surely older than this."""
        return max(self.sure_s - keep_days * DAY_S, 0.0)


class ClockNotes(msgspec.Struct, frozen=True):
    """What is kept of the clock. Times are those that the clock said."""

    hours_s: tuple[float, ...] = ()
    """After each of the last `HOURS` hours of running."""
    since_s: float = 0.0
    """How long the service has run since the last of these."""
    last_s: float | None = None
    """At the last note, or of the newest data."""
    before_leap_s: float | None = None
    """Before the clock leapt. None if it did not, if it is back, or after a day of running."""
    leapt_for_s: float = 0.0
    """How long the service has run since the last leap."""

    def noted(self, clock_s: float, ran_s: float, own_s: float = inf) -> "ClockNotes":
        """With a further note, after the service has run for a time. A note adds one hour at most.

        `own_s` is the service's own time, which its data has. It stays behind if the clock is set ahead meanwhile.
        """
        hours_s, since_s = self.hours_s, self.since_s + min(ran_s, HOUR_S)
        if since_s >= HOUR_S:
            hours_s, since_s = (*hours_s, min(clock_s, own_s))[-HOURS:], since_s - HOUR_S
        before_leap_s, leapt_for_s = self._leap(clock_s, ran_s)
        return ClockNotes(hours_s, since_s, clock_s, before_leap_s, leapt_for_s)

    def _leap(self, clock_s: float, ran_s: float) -> tuple[float | None, float]:
        last_s = clock_s if self.last_s is None else self.last_s
        before_leap_s, leapt_for_s = self.before_leap_s, self.leapt_for_s + ran_s
        if abs(clock_s - last_s - ran_s) > LEAP_S:
            before_leap_s, leapt_for_s = last_s if before_leap_s is None else before_leap_s, 0.0
        if before_leap_s is None or abs(clock_s - before_leap_s) <= LEAP_S or leapt_for_s >= DAY_S:
            return None, 0.0
        return before_leap_s, leapt_for_s

    def known_time(self, clock_s: float) -> KnownTime:
        latest_s = max((clock_s, *self.hours_s))
        if len(self.hours_s) < HOURS:
            return KnownTime(0.0, latest_s)
        since_hours = (at_s + later * HOUR_S for later, at_s in enumerate(reversed(self.hours_s)))
        return KnownTime(min(clock_s, min(since_hours) + self.since_s), latest_s)

    def checked(self) -> "ClockNotes":
        """These notes. Raises `ValueError` if a clock can't have said so."""
        times_s = [*self.hours_s, *(each for each in (self.last_s, self.before_leap_s) if each is not None)]
        is_possible = len(self.hours_s) <= HOURS and all(0.0 <= at_s <= LATEST_S for at_s in times_s)
        if not (is_possible and 0.0 <= self.since_s < HOUR_S and 0.0 <= self.leapt_for_s < DAY_S):
            raise ValueError("a time in it is no time")
        return self


class ClockFile:
    """The notes of one data directory. The supervisor writes them, and the roles read them."""

    def __init__(self, data: Path, wall: Callable[[], float] = time.time) -> None:
        self._path, self._wall = data / FILE_NAME, wall
        self._is_failing = False

    def known_time(self) -> KnownTime:
        """May wait for the disk."""
        return self.read().known_time(self._wall())

    def read(self) -> ClockNotes:
        """Empty notes while the file can't be read. May wait for the disk."""
        with suppress(OSError, *_UNREADABLE):
            return self._read()
        return ClockNotes()

    def keep(self, stop: threading.Event, steady: Callable[[], float] = time.monotonic) -> None:
        """Note the clock at once, every minute, and at the end. May wait for the disk, so it needs a thread."""
        notes, noted_s, own = self._begun(), steady(), SteadyClock(self._wall, steady)
        while True:
            is_last, now_s = stop.is_set(), steady()
            before, notes = notes, notes.noted(self._wall(), now_s - noted_s, own())
            noted_s = now_s
            if notes.before_leap_s is not None and before.before_leap_s is None:
                log.warning("%s", clock_sentence(notes, self._wall()))
            self._write(notes)
            if is_last:
                return
            stop.wait(NOTE_EVERY_S)

    def _begun(self) -> ClockNotes:
        """The notes of the file. Without it, the newest file of the directory says when the service last ran."""
        try:
            return self._read()
        except FileNotFoundError:
            pass
        except _UNREADABLE as error:
            with suppress(OSError):
                path = set_file_aside(self._path)
                log.warning("%s can't be read and is kept as %s: %s", self._path, path, error)
        except OSError as error:
            log.warning("%s can't be read: %s", self._path, error)
        return ClockNotes(last_s=_newest_s(self._path.parent))

    def _read(self) -> ClockNotes:
        return _NOTES.decode(read_file(self._path)).checked()

    def _write(self, notes: ClockNotes) -> None:
        try:
            replace_file(self._path, msgspec.json.encode(notes))
        except OSError as error:
            if not self._is_failing:
                log.warning("%s can't be written: %s", self._path, error)
            self._is_failing = True
        else:
            self._is_failing = False


_NOTES = msgspec.json.Decoder(ClockNotes)
_UNREADABLE = (msgspec.MsgspecError, ValueError, RecursionError)


def old_ones(times: Sequence[AnyTime], before: AnyTime, latest: AnyTime) -> int:
    """How many are old: of the first in the order of writing, those of a time before `before`.

    What was written after something that is not old is not old, whatever its time says. What has a time after `latest`
    is as old as the next one.
    """
    old = 0
    for number, at in enumerate(times, 1):
        if at < before:
            old = number
        elif at <= latest:
            break
    return old


def clock_sentence(notes: ClockNotes, clock_s: float) -> str:
    """What people are asked to look at after a leap; empty without one."""
    if notes.before_leap_s is None:
        return ""
    return (
        f"This machine's clock says {_minute(clock_s)}, and the newest data before was of "
        f"{_minute(notes.before_leap_s)}: look at the clock. Until the service has run for a day with it, it makes "
        "nothing old"
    )


def _minute(at_s: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(at_s))


def _newest_s(directory: Path) -> float | None:
    """When a file of a directory was last written, but hidden ones; None if there is none."""
    try:
        files = [path.stat().st_mtime for path in directory.iterdir() if path.is_file() and path.name[0] != "."]
    except OSError:
        return None
    return max(files, default=None)
