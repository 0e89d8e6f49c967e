"""The service's own clock, and the clock of each sender.

How far a sender's clock is off, and how long its messages take.

One way only, arrival less stamp is the delay less what the clock is fast by; the two cannot be told apart, but the
least of it over a while is that of the quickest message. A clock that seems off by no more than the tolerance is
taken to be right and its messages to be delayed: event times are then off by that tolerance at most. One that is off
by more is corrected as if its quickest message had taken no time: event times are then late by the least delay. Either
way none lies after the arrival.

A clock that is set forward shows at once: its stamps can't lie in the future. One that is set back looks at first like
delay. But messages that were held up come with ever less delay, so it is taken for a step once those of a second or so
show the same; one by less than `STEP_S` is followed after `WINDOW` messages at most.
"""

import logging
from collections.abc import Callable, Iterable
from math import inf, nan
from statistics import median

WINDOW = 32
"""Messages over which the quickest is sought, at most: half a minute at one a second. At least it is half as many."""
STEP_S = 1.0
"""A change of more than this between messages, beyond the resolution of the stamps, may be a step of the clock."""
AGREE_S = 0.5
"""Messages agree on a step where they differ by no more than this and the resolution of the stamps. They confirm it if
they were sent over at least twice that: so long a queue, sent at once, would differ by more."""
SLEW = 0.01
"""Seconds a second by which it leans: an hour's step is made good in four days, or at the next start."""
HOST_STEP_S = 1.0
"""A difference from the host's clock of more than this is told."""

log = logging.getLogger(__name__)


class SteadyClock:
    """Seconds since the epoch that never go back and never leap.

    Where the host's clock is set, this one goes on and only leans towards it: a service that took the step would find
    every robot silent, or every report older than the last.
    """

    def __init__(self, wall: Callable[[], float], monotonic: Callable[[], float]) -> None:
        """`wall` is the host's clock, seconds since the epoch; nobody sets `monotonic`."""
        self._wall, self._monotonic = wall, monotonic
        self._read_s = monotonic()
        self._offset_s = wall() - self._read_s
        self.off_s = 0.0
        """What the host's clock is ahead of this one."""

    def __call__(self) -> float:
        read_s = self._monotonic()
        most_s, self._read_s = SLEW * (read_s - self._read_s), read_s
        off_s = self._wall() - read_s - self._offset_s
        self._offset_s += min(max(off_s, -most_s), most_s)
        if abs(off_s) > HOST_STEP_S >= abs(self.off_s):
            log.warning("the host's clock was set by %+.1f s; the service's goes on until it is restarted", off_s)
        self.off_s = off_s
        return read_s + self._offset_s


class SenderClock:
    """The clock of one sender, from the stamps and arrivals of its messages."""

    __slots__ = (
        "_earlier_s",
        "_heard",
        "_least_s",
        "_newest_s",
        "_resolution_s",
        "_step_s",
        "_step_stamp_s",
        "_tolerance_s",
        "delay_s",
        "offset_s",
    )

    def __init__(self, tolerance_s: float) -> None:
        self._tolerance_s, self._resolution_s = tolerance_s, 0.0
        self._newest_s = nan
        """Arrival less stamp, of the newest message that fits what is known."""
        self._least_s = self._earlier_s = inf
        """The least of that in this half of the window and in the half before."""
        self._heard = 0
        """Messages in this half."""
        self._step_s = self._step_stamp_s = nan
        """Arrival less stamp, and stamp, of the first of the newest messages that agree on a step."""
        self.offset_s = 0.0
        """Added to the sender's stamps it gives service time."""
        self.delay_s = 0.0
        """Of the newest message."""

    def event_time(self, stamp_s: float, arrival_s: float, resolution_s: float) -> float:
        """Learn from one message; when what it says was true, by the service's clock, never after its arrival.

        `resolution_s` is what the last digit of its stamp is worth. Where that is much coarser than the delays it is
        the latest time that the stamp may mean.
        """
        gap_s = arrival_s - stamp_s
        self._resolution_s = resolution_s
        if not abs(gap_s - self._newest_s) > STEP_S + resolution_s or self._confirms(gap_s, stamp_s):
            self._believe(gap_s)
        offset_s = self.offset_s
        self.delay_s = max(gap_s - offset_s, 0.0)
        coarse_s = resolution_s if resolution_s > 2 * self._tolerance_s else 0.0
        return min(stamp_s + offset_s + coarse_s, arrival_s)

    def _believe(self, gap_s: float) -> None:
        self._newest_s, self._step_s = gap_s, nan
        if self._heard == WINDOW // 2:
            self._earlier_s, self._least_s, self._heard = self._least_s, inf, 0
        self._heard += 1
        if gap_s < self._least_s:
            self._least_s = gap_s
            least_s = min(gap_s, self._earlier_s)
            self.offset_s = 0.0 if abs(least_s) <= self._tolerance_s else least_s

    def _confirms(self, gap_s: float, stamp_s: float) -> bool:
        """Whether messages over a long enough time agree on a step; if so, what was known before is forgotten."""
        most_s = AGREE_S + self._resolution_s
        if not abs(gap_s - self._step_s) <= most_s:
            self._step_s, self._step_stamp_s = gap_s, stamp_s
        if stamp_s - self._step_stamp_s < 2 * most_s:
            return False
        self._least_s, self._earlier_s, self._heard = inf, self._step_s, 0
        return True


def vendor_offset(clocks: Iterable[SenderClock]) -> float:
    """The median offset of a vendor's robots, which mostly share a clock; 0 for none."""
    offsets_s = [clock.offset_s for clock in clocks]
    return median(offsets_s) if offsets_s else 0.0
