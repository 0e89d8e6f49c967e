"""Robots that do what they were advised. The outcomes of their pairs do not show how good forecasts are.

Advice that is followed prevents the conflict. If the models learned from that, they would doubt the next conflict, and
a vendor's forecasts would look wrong because its robots follow advice. A robot follows advice if it was on its way when
it was advised to wait, and its reports since then show that it stands. Robots also stop by themselves, before what is
in their way: one that came to stand with another body right ahead shows nothing. What else it is asked, for one other
robot (`deconflict/adviser/`), says nothing of its other pairs.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from deconflict.foresight.keyed_tables import KeyedTable
from deconflict.foresight.motion_assumptions import JOINED_S
from deconflict.foresight.probability.pair_table import has_robot_of, slots_of
from deconflict.sweep.geometry.envelope_distances import gap
from deconflict.sweep.robot_slots import lengthen
from deconflict_client.advisory import AnyAdvisory
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import FLOAT, FLOATS, MATRIX, kernel

NOBODY: Ints = np.empty(0, np.int64)
ONE_WAIT_S = 15.0
"""Times at which a robot was seen to wait belong to one wait if they are less apart."""
STOPS_M = 1.1
"""A robot stops by itself before a body that is as near ahead."""
BY_SLOT = "_advised_until_s", "_was_moving", "_since_s", "_last_s"
KEPT_S = 600.0
"""A pair is known to have followed advice for so long: losses are reported when they end, or last 60 s."""


def waits_until_s(revisions: Iterable[AnyAdvisory]) -> dict[str, float]:
    """Until when each robot should wait, by the advice of these revisions."""
    until_s: dict[str, float] = {}
    for revision in revisions:
        advice = revision.recommendation
        if advice is None:
            continue
        ends_s = [(hold.robot, revision.updated_at.timestamp() + hold.hold_s) for hold in advice.holds]
        ends_s += [(slot.robot, slot.start_at.timestamp()) for slot in advice.slots if slot.wait_s > 0]
        for robot, end_s in ends_s:
            until_s[robot] = max(end_s, until_s.get(robot, end_s))
    return until_s


@kernel(FLOATS(MATRIX, *[FLOATS] * 2, *[FLOAT] * 2))
def _own_until_s(newest: Floats, since_s: Floats, last_s: Floats, asked_s: float, horizon_s: float) -> Floats:
    until_s = newest[:, 0].copy()
    for slot in range(len(until_s)):
        if since_s[slot] <= asked_s + horizon_s and last_s[slot] >= asked_s:
            until_s[slot] = min(until_s[slot], since_s[slot]) if since_s[slot] > asked_s else -np.inf
    return until_s


def _is_stopped(slot: int, newest: Floats, half_m: Floats) -> bool:
    """Whether a robot has another body within `STOPS_M` ahead. The arrays are those of `record_waits`."""
    at_s, x_m, y_m, yaw_rad, floor = newest[slot]
    others = np.flatnonzero((newest[:, 4] == floor) & (newest[:, 0] >= at_s - JOINED_S))
    others = others[others != slot]
    dx_m = newest[others, 1] - x_m - STOPS_M / 2 * np.cos(yaw_rad)
    dy_m = newest[others, 2] - y_m - STOPS_M / 2 * np.sin(yaw_rad)
    longer_m = np.tile(half_m[:, [slot]] + np.array([[STOPS_M / 2], [0.0]]), len(others))
    own_rad = np.full(len(others), yaw_rad)
    return bool((gap(dx_m, dy_m, own_rad, newest[others, 3], longer_m, half_m[:, others]) == 0.0).any())


class AdviceFollowers:
    """By slot: until when a robot is advised to wait, and from when until when its reports show that it does.

    By pair: from when until when one of the two did what it was asked for the other.
    """

    def __init__(self) -> None:
        self._advised_until_s = np.zeros(0)
        self._was_moving = np.zeros(0, np.bool_)
        """Whether the robot was on its way when it was first advised, and no other body has stopped it since."""
        self._since_s = np.zeros(0)
        """When the last wait began."""
        self._last_s = np.zeros(0)
        """When the robot was last seen to wait."""
        self._is_any_advised = False
        self._of_pair: dict[int, tuple[float, float]] = {}
        """By code of a pair, from when until when."""

    def table(self, slots: Mapping[str, int]) -> KeyedTable:
        """What is known of these robots, by UUID."""
        self._is_any_advised = True
        columns = {name: getattr(self, name) for name in BY_SLOT}
        return KeyedTable([(uuid,) for uuid in slots], list(slots.values()), columns)

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        more = slots - len(self._was_moving)
        if more > 0:
            lengthen(self, BY_SLOT, more)
            self.forget(np.arange(slots - more, slots))

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on."""
        self._advised_until_s[slots] = self._since_s[slots] = self._last_s[slots] = -np.inf
        code = np.array(list(self._of_pair), np.int64)
        for gone in code[has_robot_of(code, slots)].tolist():
            del self._of_pair[gone]

    def note_advice(self, slot: int, now_s: float, until_s: float, stands: bool) -> None:
        """A robot should wait until `until_s`. `stands` is whether it stands already."""
        if now_s > self._advised_until_s[slot]:
            self._was_moving[slot] = not stands
        self._advised_until_s[slot], self._is_any_advised = until_s, True

    def note_followed(self, code: int, now_s: float) -> None:
        """One robot of a pair does what it was asked for the other."""
        if code not in self._of_pair:
            self._of_pair = {of: span for of, span in self._of_pair.items() if span[1] >= now_s - KEPT_S}
        since_s, last_s = self._of_pair.get(code, (now_s, now_s))
        self._of_pair[code] = (since_s if now_s - last_s <= ONE_WAIT_S else now_s), now_s

    def record_waits(self, slots: Ints, stand: Bools, newest: Floats, half_m: Floats) -> Ints:
        """Take in reports of robots `slots` (n,); `stand` (n,) marks those that stand. `newest` (slots, 5) are the
        newest reports of all robots, and `half_m` (2, slots) their half sides. Returns the slots of those that wait as
        advised."""
        if not self._is_any_advised:
            return NOBODY
        waits = slots[stand & self._was_moving[slots] & (newest[slots, 0] <= self._advised_until_s[slots])]
        begins = waits[newest[waits, 0] - self._last_s[waits] > ONE_WAIT_S]
        for slot in begins.tolist():
            self._was_moving[slot] = not _is_stopped(slot, newest, half_m)
        waits, begins = (found[self._was_moving[found]] for found in (waits, begins))
        self._last_s[waits], self._since_s[begins] = newest[waits, 0], newest[begins, 0]
        return waits

    def last_wait_s(self, slot: int | None) -> float:
        """When a robot was last seen to wait as advised; -inf if it never was, or without a slot."""
        return -np.inf if slot is None else float(self._last_s[slot])

    def waiting(self, since_s: float) -> Ints:
        """Slots of the robots that were seen to wait at `since_s` or later."""
        return np.flatnonzero(self._last_s >= since_s) if self._is_any_advised else NOBODY

    def followed(self, since_s: float) -> Ints:
        """Codes of the pairs of which one robot did what it was asked for the other at `since_s` or later."""
        return np.array([code for code, (_, last_s) in self._of_pair.items() if last_s >= since_s], np.int64)

    def has_followed(self, code: int, at_s: float) -> bool:
        """Whether one robot of a pair did what it was asked for the other at `at_s`."""
        since_s, last_s = self._of_pair.get(code, (np.inf, -np.inf))
        return since_s <= at_s <= last_s

    def own_until_s(self, newest: Floats, code: Ints, asked_s: float, horizon_s: float) -> Floats:
        """(p,) until when both robots of each pair `code` (p,), ascending, were heard and neither followed advice,
        within the horizon from `asked_s`; -inf if one did already at `asked_s`. `newest` (slots, 5) are the newest
        reports."""
        robot_s = _own_until_s(newest, self._since_s, self._last_s, asked_s, horizon_s)
        a, b = slots_of(code)
        until_s = np.minimum(robot_s[a], robot_s[b])
        for followed, (since_s, last_s) in self._of_pair.items():
            if since_s <= asked_s + horizon_s and last_s >= asked_s:
                row = slice(*np.searchsorted(code, (followed, followed + 1)))
                until_s[row] = np.minimum(until_s[row], since_s) if since_s > asked_s else -np.inf
        return until_s
