"""How far a sender's clock is off, and how long its messages take.

One way only, arrival less stamp is the delay less what the clock is fast by; the two cannot be told apart, but the
least of it over a while is that of the quickest message. A clock that seems off by less than the tolerance is taken
to be right and its messages to be delayed; one that is off by more is corrected as if its quickest message had
taken no time, so a forecast may be early by the least delay, never late.
"""

from collections import deque
from collections.abc import Iterable
from statistics import median

WINDOW = 32
"""Messages over which the quickest is sought: half a minute at one a second."""
STEP_S = 5.0
"""A change of more than this between messages is a step of the clock, once confirmed."""
CONFIRM = 3
"""Messages that must agree on a step."""


class SenderClock:
    """The clock of one sender, from the stamps and arrivals of its messages."""

    __slots__ = ("_gaps_s", "_resolution_s", "_stepped_s", "_tolerance_s", "delay_s", "offset_s")

    def __init__(self, tolerance_s: float) -> None:
        self._tolerance_s = tolerance_s
        self._gaps_s: deque[float] = deque(maxlen=WINDOW)
        """Arrival less stamp, of the newest messages."""
        self._stepped_s: list[float] = []
        self._resolution_s = 0.0
        self.offset_s = 0.0
        """Added to the sender's stamps it gives service time."""
        self.delay_s = 0.0
        """Of the newest message."""

    def update(self, stamp_s: float, arrival_s: float, resolution_s: float) -> None:
        """Learn from one message; `resolution_s` is what the last digit of its stamp is worth."""
        gap_s = arrival_s - stamp_s
        self._resolution_s = resolution_s
        if self._gaps_s and abs(gap_s - self._gaps_s[-1]) > STEP_S:
            self._stepped_s.append(gap_s)
            if len(self._stepped_s) < CONFIRM:
                return
            self._gaps_s.clear()
            self._gaps_s.extend(self._stepped_s)
        self._stepped_s.clear()
        self._gaps_s.append(gap_s)
        least_s = min(self._gaps_s)
        self.offset_s = 0.0 if abs(least_s) <= self._tolerance_s else least_s
        self.delay_s = max(gap_s - self.offset_s, 0.0)

    def event_s(self, stamp_s: float, arrival_s: float) -> float:
        """When what the message says was true, by the service's clock; never after its arrival.

        A stamp much coarser than the delays tells less than the arrival, and so does one of a clock that seems to
        have stepped, until the step is confirmed.
        """
        if self._stepped_s or self._resolution_s > 2 * self._tolerance_s:
            return arrival_s
        return min(stamp_s + self.offset_s, arrival_s)


def vendor_offset(clocks: Iterable[SenderClock]) -> float:
    """The median offset of a vendor's robots, which mostly share a clock; 0 for none."""
    offsets_s = [clock.offset_s for clock in clocks]
    return median(offsets_s) if offsets_s else 0.0
