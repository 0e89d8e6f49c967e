"""Robots that wait because they were advised to: how their pairs end says nothing of what forecasts are worth.

Advice that is followed makes a conflict come to nothing. Learned from, that would teach to doubt the next one, and
would have a vendor's forecasts look wrong because its robots do as they are asked. A robot heeds advice where it was on
its way when it was told to wait, and reports since show that it stands.
"""

from collections.abc import Iterable

import numba
import numpy as np

from deconflict.advisory import AdvisoryState, AnyAdvisory
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import kernel

_INTS, _FLOATS, _BOOLS = numba.int64[::1], numba.float64[::1], numba.boolean[::1]
_STAMPS = numba.types.Array(numba.float64, 1, "C", readonly=True)
NOBODY: Ints = np.empty(0, np.int64)
ONE_WAIT_S = 15.0
"""Times at which a robot was seen to wait that are less apart are one wait."""


def waits_until_s(revisions: Iterable[AnyAdvisory]) -> dict[str, float]:
    """Until when each robot should wait, by the advice of these revisions."""
    until_s: dict[str, float] = {}
    for one in revisions:
        advice = one.recommendation
        if advice is None or one.state is AdvisoryState.CLEARED:
            continue
        told = [(hold.robot, one.updated_at.timestamp() + hold.hold_s) for hold in advice.holds]
        told += [(slot.robot, slot.start_at.timestamp()) for slot in advice.slots if slot.wait_s > 0]
        for robot, end_s in told:
            until_s[robot] = max(end_s, until_s.get(robot, end_s))
    return until_s


@kernel(_INTS(_FLOATS, _BOOLS, *[_FLOATS] * 2, _INTS, _STAMPS, _BOOLS, numba.float64))
def _see(
    advised_until_s: Floats,
    went: Bools,
    since_s: Floats,
    last_s: Floats,
    slots: Ints,
    event_s: Floats,
    stand: Bools,
    one_wait_s: float,
) -> Ints:
    """What `AdviceFollowers.see` does to its columns, and gives."""
    waits, n = np.empty(len(slots), np.int64), 0
    for row, slot in enumerate(slots):
        if stand[row] and went[slot] and event_s[row] <= advised_until_s[slot]:
            if event_s[row] - last_s[slot] > one_wait_s:
                since_s[slot] = event_s[row]
            last_s[slot], waits[n] = event_s[row], slot
            n += 1
    return waits[:n].copy()


@kernel(_FLOATS(numba.float64[:, ::1], *[_FLOATS] * 2, *[numba.float64] * 2))
def _own_until_s(seen: Floats, since_s: Floats, last_s: Floats, asked_s: float, horizon_s: float) -> Floats:
    until_s = seen[:, 0].copy()
    for slot in range(len(until_s)):
        if since_s[slot] <= asked_s + horizon_s and last_s[slot] >= asked_s:
            until_s[slot] = min(until_s[slot], since_s[slot]) if since_s[slot] > asked_s else -np.inf
    return until_s


class AdviceFollowers:
    """By slot: until when a robot is advised to wait, and since and until when it was seen to."""

    def __init__(self) -> None:
        self._advised_until_s = np.zeros(0)
        self._went = np.zeros(0, np.bool_)
        """Whether it was on its way when it was first told."""
        self._since_s = np.zeros(0)
        self._last_s = np.zeros(0)
        self._is_any_advised = False

    def grow(self, slots: int) -> None:
        more = slots - len(self._went)
        if more > 0:
            for name in ("_advised_until_s", "_went", "_since_s", "_last_s"):
                column = getattr(self, name)
                setattr(self, name, np.concatenate([column, np.zeros(more, column.dtype)]))
            self.forget(np.arange(slots - more, slots))

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        self._advised_until_s[slots] = self._since_s[slots] = self._last_s[slots] = -np.inf

    def advise(self, slot: int, now_s: float, until_s: float, stands: bool) -> None:
        """A robot should wait until then; `stands` is whether it does already."""
        if now_s > self._advised_until_s[slot]:
            self._went[slot] = not stands
        self._advised_until_s[slot], self._is_any_advised = until_s, True

    def see(self, slots: Ints, event_s: Floats, stand: Bools) -> Ints:
        """Those of `slots` (n,) that, as their reports show, wait as advised; `stand` (n,) is which of them stand."""
        if not self._is_any_advised:
            return NOBODY
        columns = (self._advised_until_s, self._went, self._since_s, self._last_s)
        return _see(*columns, slots, event_s, stand, ONE_WAIT_S)

    def waiting(self, since_s: float) -> Ints:
        """Slots of the robots that were seen to wait at that moment or later."""
        return np.flatnonzero(self._last_s >= since_s) if self._is_any_advised else NOBODY

    def own_until_s(self, seen: Floats, asked_s: float, horizon_s: float) -> Floats:
        """(slots,) until when each robot was `seen` (slots, 5) and went its own way, within the horizon of a question
        asked at `asked_s`: -inf where it waited as advised already."""
        return _own_until_s(seen, self._since_s, self._last_s, asked_s, horizon_s)
