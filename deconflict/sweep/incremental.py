"""A floor that is swept again and again: only robots that changed are, against all others."""

from collections.abc import Iterable, Sequence
from itertools import chain, repeat
from math import ceil, floor, inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.broadphase import PAIR, Boxes, Pairs, in_order
from deconflict.sweep.contact_intervals import (
    CONTACT_INTERVAL,
    ContactIntervals,
    PairNames,
    by_pair,
    in_span,
    joined,
    kept,
    mended,
    met,
)
from deconflict.sweep.fcl_check import FclCheck
from deconflict.sweep.geometry.encounter import Encounters, encounters
from deconflict.sweep.geometry.knots import Knots, Robots, faults
from deconflict.sweep.narrowphase import Found, Span, meet, motions_of, smallest_of, start_distances
from deconflict.sweep.slot_table import SlotTable
from ingest.batch import Bools, Floats, Forecasts, Ints

TOLERANCE_M = 1e-3
"""First contact is the first time within so much of the clearance."""
ACCURACY_M = 1e-3
"""Of the smallest separation."""
ROUNDS = 100
"""Of advancement, after which a pair is left open, and FCL decides."""
AHEAD = 1
"""Slabs covered beyond the horizon, so that a robot that reports every second is covered once for each report."""


class PairConflicts(NamedTuple):
    """c pairs that come within the clearance, ascending by keys, and what the pass cost."""

    pairs: tuple[tuple[str, str], ...]
    before: Ints
    """(c,) the place of each pair among those of the last pass; -1 where it is not known to be one."""
    contact_s: Floats
    """(c,) first time within the clearance, to a millimetre and never late; `now_s` where they begin so."""
    separation_m: Floats
    """(c,) smallest distance of the envelopes over the horizon, to a millimetre; 0 where they overlap."""
    separation_at_s: Floats
    """(c,) a time at which it is reached."""
    start_separation_m: Floats
    """(c,) distance at `now_s`, or when the later of the two appears; inf where that is on another floor."""
    fresh: Bools
    """(c,) whether either robot's forecast is new since the last pass."""
    box_pairs: int
    """Pairs of robots and slabs that the broad phase left."""
    segment_pairs: int
    """Pairs of segments that were looked at."""
    advanced_pairs: int
    """Of those, the ones whose circles come near enough for a closer look."""
    fcl_calls: int


Where = tuple[NDArray[Any], Robots, Knots]
"""Boxes, robots and knots, by slot."""


class Sweeper:
    """Keeps meetings by pair and slab of absolute time, so that they hold as the horizon moves on.

    Each pass sweeps the robots that changed, and looks again only at meetings that an edge of the horizon cuts. The
    answer depends on what is on the floor, not on the order or the batches in which it came.
    """

    def __init__(self, *, clearance_m: float, horizon_s: float = 10.0) -> None:
        if not clearance_m >= 0 or not 0 < horizon_s < float("inf"):
            raise ValueError("clearance_m must be at least 0 and horizon_s above 0")
        self._clearance_m, self._horizon_s = clearance_m, horizon_s
        self._accuracy_m = ACCURACY_M
        self._slabs = ceil(horizon_s) + 1 + AHEAD
        self._slot_table = SlotTable()
        self._touched: Bools = np.zeros(0, bool)
        """(slots,) whether a slot's robot changed or left since the last pass."""
        self._told: Bools = np.zeros(0, bool)
        """(slots,) whether a slot's forecast is new since the last pass."""
        self._since: Ints = np.zeros(0, np.int64)
        """(slots,) the first slab from which on a robot has boxes without a gap."""
        self._covered: Ints = np.zeros(0, np.int64)
        """(slots,) the last slab for which a robot has boxes."""
        self._first_slab = 0
        """Of the last pass: only where time goes back from it do boxes lack that were covered."""
        self._boxes = Boxes(self._slabs)
        self._rings: Ints = np.arange(2 * self._slabs) % self._slabs
        """Of slabs in a row, from any on."""
        self._meetings: ContactIntervals = np.empty(0, CONTACT_INTERVAL)
        self._names = PairNames()
        self._box_pairs = self._segment_pairs = self._advanced_pairs = 0

    def update(
        self, keys: Sequence[str], forecasts: Forecasts, widened_m: Floats | None = None
    ) -> tuple[tuple[str, str], ...]:
        """Replace the forecasts of `keys`, one row each; key and reason of those that can't be swept.

        The envelopes are `widened_m` (n,) longer and wider than the robots are; as they are where that is not given.

        A robot whose new forecast is invalid is off the floor until its next one: its old forecast is no longer what
        it says. Of a key that is there twice the later row counts.
        """
        if len(set(keys)) == len(keys) and self._put(keys, forecasts, widened_m):
            return ()
        wrong, newest = faults(forecasts), {key: row for row, key in enumerate(keys)}
        self.discard(key for key, row in newest.items() if row in wrong)
        newest = {key: row for key, row in newest.items() if row not in wrong}
        rows = list(newest.values())
        self._put(list(newest), forecasts.take(rows), None if widened_m is None else widened_m[rows])
        return tuple((keys[row], reason) for row, reason in sorted(wrong.items()))

    def _put(self, keys: Sequence[str], forecasts: Forecasts, widened_m: Floats | None) -> bool:
        """Whether the forecasts of `keys`, which are all different, could be replaced: not where any is invalid."""
        slots = self._slot_table.replace_forecasts(keys, forecasts, 0.0 if widened_m is None else widened_m)
        for flags in (self._touched, self._told):
            flags.resize(len(self._slot_table), refcheck=False)
            if slots is not None:
                flags[slots] = True
        return slots is not None

    def discard(self, keys: Iterable[str]) -> None:
        """Take robots off the floor."""
        if left := self._slot_table.discard(keys):
            self._touched[left] = True

    def encounters(self, pairs: Sequence[tuple[str, str]], at_s: Floats) -> Encounters:
        """(n,) of `ENCOUNTER`: how the robots of n pairs, as long and wide as they are, meet at each of the times."""
        slots = np.fromiter(
            map(self._slot_table.slots.get, chain.from_iterable(pairs), repeat(-1)), np.int64, 2 * len(pairs)
        )
        return encounters(self._slot_table.robots, self._slot_table.knots, self._slot_table.widened_m, slots, at_s)

    def copied(self, keys: Sequence[str]) -> tuple[Robots, Knots]:
        """The robots of `keys` as they are on the floor, and their knots; those that are not have none."""
        return self._slot_table.copied(keys)

    def find_conflicts(self, now_s: float, reach_s: float = inf, accuracy_m: float = 0.0) -> PairConflicts:
        """The conflicts in [`now_s`, `now_s` + horizon], or in the shorter `reach_s`.

        The smallest separations of the pairs that are looked at anew are told to `accuracy_m` where that is coarser
        than a millimetre, never too small.
        """
        self._accuracy_m, reach_s = max(accuracy_m, ACCURACY_M), min(reach_s, self._horizon_s)
        self._box_pairs = self._segment_pairs = self._advanced_pairs = 0
        decider = FclCheck(self._clearance_m, TOLERANCE_M)
        first_slab, last_slab = floor(now_s), floor(now_s + reach_s)
        is_changed, told = self._taken_in(first_slab)
        self._meetings, changed = kept(self._meetings, is_changed, first_slab), np.flatnonzero(is_changed)
        slabs = ceil(reach_s) + 1 + AHEAD
        pairs = [self._covered_anew(changed, first_slab, slabs), *self._covered_further(first_slab, last_slab, slabs)]
        for some in pairs:
            self._meetings = joined(self._meetings, self._meet(some, decider), self._slot_table.ranks())
        return self._listed(self._within(now_s, now_s + reach_s, decider), now_s, told, decider)

    def _taken_in(self, first_slab: int) -> tuple[Bools, Bools]:
        """Which slots to cover anew, and which have a new forecast."""
        slots = len(self._slot_table)
        for column in (self._since, self._covered):
            column.resize(slots, refcheck=False)
        self._boxes.grow(slots)
        is_changed, told = self._touched, self._told
        if first_slab < self._first_slab:
            is_changed |= np.maximum(self._since, self._covered - self._slabs + 1) > first_slab
        self._touched, self._told, self._first_slab = np.zeros(slots, bool), np.zeros(slots, bool), first_slab
        return is_changed, told

    def _covered_anew(self, changed: Ints, first_slab: int, slabs: int) -> Pairs:
        """Cover the robots of `changed` in so many slabs from `first_slab` on; the pairs of boxes to look at."""
        self._since[changed] = first_slab
        self._cover(changed, first_slab, slabs, anew=True)
        return self._boxes.pairs(changed, self._rings_of(first_slab, slabs))

    def _covered_further(self, first_slab: int, last_slab: int, slabs: int) -> list[Pairs]:
        """Cover robots without news in the slabs that have come into view; the pairs of boxes to look at."""
        behind, found = np.flatnonzero(self._covered < last_slab), []
        if not len(behind):
            return []
        behind = self._slot_table.present(behind)
        for covered in sorted(set(self._covered[behind].tolist())):
            slots = behind[self._covered[behind] == covered]
            begin, end = max(covered + 1, first_slab), first_slab + slabs
            if begin > covered + 1:
                self._since[slots] = begin
            self._cover(slots, begin, end - begin)
            found.append(self._boxes.pairs(slots, self._rings_of(begin, end - begin)))
        return found

    def _rings_of(self, first_slab: int, slabs: int) -> Ints:
        """The ring rows of so many slabs."""
        first = first_slab % self._slabs
        return self._rings[first : first + slabs]

    def _cover(self, slots: Ints, first_slab: int, slabs: int, *, anew: bool = False) -> None:
        self._covered[slots] = first_slab + slabs - 1
        grow_m = self._clearance_m / 2 + TOLERANCE_M
        self._boxes.cover(slots, self._slot_table.robots, self._slot_table.knots, first_slab, slabs, grow_m, anew=anew)

    def _meet(self, pairs: Pairs, decider: FclCheck) -> ContactIntervals:
        """The meetings of pairs in their slabs."""
        pairs = in_order(pairs, self._slot_table.ranks(), self._slot_table.robots)
        return met(pairs, self._looked_at(pairs, (-inf, inf), decider), self._boxes.all)

    def _looked_at(self, pairs: Pairs, span: Span, decider: FclCheck) -> Found:
        """What becomes of each pair within `span`, counted; what advancement leaves open FCL decides."""
        boxes, robots, knots = self._where()
        found, opened, looked_at, advanced = meet(
            pairs, boxes, robots, knots, span, self._clearance_m, TOLERANCE_M, self._accuracy_m, ROUNDS
        )
        self._box_pairs += len(pairs)
        self._segment_pairs += looked_at
        self._advanced_pairs += advanced
        for row in np.flatnonzero(found["open"] < inf).tolist() if opened else ():
            motions = motions_of(pairs[row : row + 1], boxes, robots, knots, span)
            contact = decider.first_contact(motions, float(found["open"][row]))
            least = smallest_of(motions, self._accuracy_m) if contact < inf else (inf, inf)
            found[row] = (contact, *least, inf)
        return found

    def _where(self) -> Where:
        return self._boxes.all, self._slot_table.robots, self._slot_table.knots

    def _within(self, begin_s: float, end_s: float, decider: FclCheck) -> ContactIntervals:
        """The meetings of the horizon; what one of its edges cuts off is looked for again in the part inside."""
        pairs = np.empty(len(self._meetings), PAIR)
        some, cut = in_span(self._meetings, begin_s, end_s, self._slabs, pairs)
        if not len(cut):
            return some
        return mended(some, cut, self._looked_at(pairs[: len(cut)], (begin_s, end_s), decider), begin_s, end_s)

    def _listed(self, m: ContactIntervals, now_s: float, told: Bools, decider: FclCheck) -> PairConflicts:
        a, b, contact_s, separation_m, separation_at_s, fresh = by_pair(m, told, now_s)
        pairs, before = self._names.of(a, b, self._slot_table.keys, self._slot_table.ranks())
        return PairConflicts(
            pairs=pairs,
            before=before,
            contact_s=contact_s,
            separation_m=separation_m,
            separation_at_s=separation_at_s,
            start_separation_m=start_distances(a, b, *self._where(), now_s),
            fresh=fresh,
            box_pairs=self._box_pairs,
            segment_pairs=self._segment_pairs,
            advanced_pairs=self._advanced_pairs,
            fcl_calls=decider.calls,
        )
