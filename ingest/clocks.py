"""The service's own clock, and an estimate of the clock of each sender.

The estimate finds how far a sender's clock is off, and how long its messages take.

With messages in one direction only, arrival minus stamp is the delay minus the time by which the clock is fast. The two
can't be separated, but the least value over a while belongs to the quickest message. A clock that seems off by at most
the tolerance is taken to be right, and its messages to be delayed: event times are then off by at most the tolerance. A
clock that is off by more is corrected as if its quickest message had taken no time: event times are then late by the
least delay. In both cases no event time lies after the arrival.

A clock that is set forward shows at once, since its stamps can't lie in the future. A clock that is set back looks at
first like a delay. But messages that were held up arrive with smaller and smaller delays. So it is taken to be a step
of the clock once the messages of about a second show the same value. A step back by less than `STEP_S` is followed
after at most `WINDOW` messages.
"""

import logging
from collections.abc import Callable, Iterable
from math import inf, nan
from statistics import median

WINDOW = 32
"""The quickest of at most this many messages counts, and of at least half as many: half a minute at one a second."""
STEP_S = 1.0
"""A change between messages by more than this plus the resolution of the stamps may be a step of the clock."""
AGREE_S = 0.5
"""Messages agree on a step if they differ by at most this plus the resolution of the stamps. They confirm it if they
were sent over at least twice that time: a queue of that length, sent at once, would differ by more."""
ONE_STAMP_S = 1.0
"""Messages of one second may have one stamp. The later ones were sent later by as much as they came."""
SLEW = 0.01
"""Seconds per second by which the clock is slewed: a step of an hour is corrected in four days, or at a restart."""
HOST_STEP_S = 1.0
"""A greater difference from the host's clock is logged."""

log = logging.getLogger(__name__)


class SteadyClock:
    """Seconds since the epoch that never go back and never jump.

    If the host's clock is set, this one continues and slowly approaches it. A service that followed the step would find
    every robot silent, or every report older than the last.
    """

    def __init__(self, wall: Callable[[], float], monotonic: Callable[[], float]) -> None:
        """`wall` is the host's clock, seconds since the epoch. `monotonic` is never set."""
        self._wall, self._monotonic = wall, monotonic
        self._read_s = monotonic()
        self._offset_s = wall() - self._read_s
        self.off_s = 0.0
        """How far the host's clock is ahead of this one."""

    def __call__(self) -> float:
        read_s = self._monotonic()
        most_s, self._read_s = SLEW * (read_s - self._read_s), read_s
        off_s = self._wall() - read_s - self._offset_s
        self._offset_s += min(max(off_s, -most_s), most_s)
        if abs(off_s) > HOST_STEP_S >= abs(self.off_s):
            log.warning("the host's clock was set by %+.1f s; the service follows slowly until it is restarted", off_s)
        self.off_s = off_s
        return read_s + self._offset_s


class SenderClock:
    """An estimate of the clock of one sender, from the stamps and arrivals of its messages."""

    __slots__ = (
        "_arrived_s",
        "_earlier_s",
        "_gaps_s",
        "_least_s",
        "_messages",
        "_newest_s",
        "_resolution_s",
        "_step_s",
        "_step_stamp_s",
        "_tolerance_s",
        "_within_s",
        "delay_s",
        "offset_s",
        "stamp_s",
        "stands_s",
    )

    def __init__(self, tolerance_s: float) -> None:
        self._tolerance_s, self._resolution_s = tolerance_s, 0.0
        self._newest_s = nan
        """Arrival minus stamp of the newest message that agrees with the earlier ones."""
        self._least_s = self._earlier_s = inf
        """The least arrival minus stamp in this half of the window and in the half before."""
        self._messages = 0
        """Messages in this half of the window."""
        self._step_s = self._step_stamp_s = nan
        """Arrival minus stamp, and stamp, of the first of the newest messages that agree on a step."""
        self.offset_s = 0.0
        """The sender's stamps plus this are service time."""
        self.delay_s = 0.0
        """The delay of the newest message."""
        self.stamp_s = self._arrived_s = nan
        """Its stamp, and when it arrived."""
        self._within_s = 0.0
        """For how long messages that follow each other quickly have had that stamp."""
        self._gaps_s: tuple[float, ...] = ()
        """The two longest times between two of these messages, the longest first."""
        self.stands_s = 0.0
        """For how long messages in a row have had that stamp. The longest gap between two of them counts as the second
        longest: what was sent in one second may have been held up in between."""

    def event_time(self, stamp_s: float, arrival_s: float, resolution_s: float, *, is_repeated: bool = False) -> float:
        """Update the estimate with a message. Returns its stamp in service time, never after its arrival.

        `resolution_s` is the resolution of its stamp. If that is much coarser than the delays, the result is the latest
        time that the stamp may mean. A message `is_repeated` if it is the last one again.
        """
        gap_s = arrival_s - stamp_s
        self._note_stamp(stamp_s, arrival_s, is_repeated=is_repeated)
        self._resolution_s = resolution_s
        if not abs(gap_s - self._newest_s) > STEP_S + resolution_s or self._confirms(gap_s, stamp_s):
            self._add(gap_s)
        offset_s = self.offset_s
        self.delay_s = max(gap_s - offset_s, 0.0)
        coarse_s = resolution_s if resolution_s > 2 * self._tolerance_s else 0.0
        within_s = min(self._within_s, ONE_STAMP_S) if not coarse_s else 0.0
        return min(stamp_s + offset_s + coarse_s + within_s, arrival_s)

    def _note_stamp(self, stamp_s: float, arrival_s: float, *, is_repeated: bool) -> None:
        since_s = arrival_s - self._arrived_s
        if stamp_s == self.stamp_s:
            before_s = sum(self._gaps_s[:1]) - sum(self._gaps_s[1:])
            self._gaps_s = tuple(sorted((*self._gaps_s, since_s), reverse=True)[:2])
            after_s = sum(self._gaps_s[:1]) - sum(self._gaps_s[1:])
            self.stands_s += since_s + before_s - after_s
            self._within_s += since_s if since_s < ONE_STAMP_S and not is_repeated else 0.0
        else:
            self._gaps_s, self.stands_s, self._within_s = (), 0.0, 0.0
        self.stamp_s, self._arrived_s = stamp_s, arrival_s

    def _add(self, gap_s: float) -> None:
        self._newest_s, self._step_s = gap_s, nan
        if self._messages == WINDOW // 2:
            self._earlier_s, self._least_s, self._messages = self._least_s, inf, 0
        self._messages += 1
        if gap_s < self._least_s:
            self._least_s = gap_s
            least_s = min(gap_s, self._earlier_s)
            self.offset_s = 0.0 if abs(least_s) <= self._tolerance_s else least_s

    def _confirms(self, gap_s: float, stamp_s: float) -> bool:
        """Whether messages over a long enough time agree on a step. If so, the estimate starts again."""
        most_s = AGREE_S + self._resolution_s
        if not abs(gap_s - self._step_s) <= most_s:
            self._step_s, self._step_stamp_s = gap_s, stamp_s
        if stamp_s - self._step_stamp_s < 2 * most_s:
            return False
        self._least_s, self._earlier_s, self._messages = inf, self._step_s, 0
        return True


def vendor_offset(clocks: Iterable[SenderClock]) -> float:
    """The median offset of a vendor's robots, which mostly share a clock; 0 for none."""
    offsets_s = [clock.offset_s for clock in clocks]
    return median(offsets_s) if offsets_s else 0.0
