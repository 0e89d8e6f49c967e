"""The sweep of a floor, pass after pass: only robots that changed are swept, against all others."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from math import ceil, floor, inf

import numpy as np

from deconflict.sweep.broadphase import PAIR, Pairs, SweptBoxes, sorted_pairs
from deconflict.sweep.contact_intervals import (
    CONTACT_INTERVAL,
    ContactIntervals,
    PairConflicts,
    by_pair,
    in_span,
    intervals_of,
    merged,
    still_valid,
    with_contacts,
)
from deconflict.sweep.fcl_check import FclCheck
from deconflict.sweep.geometry.encounter import Encounters, encounters
from deconflict.sweep.geometry.knots import Knots, Robots, faults
from deconflict.sweep.narrowphase import (
    Contacts,
    Span,
    find_contacts,
    motions_of,
    smallest_separation,
    start_distances,
)
from deconflict.sweep.pair_choice import NO_CROWDS, Claims, CrowdedPairs, PairChoice
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.shapes.shape_contacts import shape_distances
from deconflict.sweep.shapes.shape_decisions import FloorState, ShapeDecisions, is_shaped
from deconflict.sweep.shapes.shape_places import set_places
from deconflict.sweep.shapes.shape_table import SHAPES
from deconflict.sweep.shapes.trains import Meetings, Trains, of_trains, pairs_of_bodies, pulled_by
from deconflict.sweep.slot_table import SlotTable
from ingest.batch import Bools, Floats, Forecasts, Ints

TOLERANCE_M = 1e-3
"""First contact is the first time at which the distance is within this of the clearance."""
ACCURACY_M = 1e-3
"""Accuracy of the smallest separation."""
ROUNDS = 100
"""After this many steps of advancement a pair is left open, and FCL decides."""
AHEAD = 1
"""So many slabs are covered beyond the horizon, so that a robot that reports every second is covered once for each
report."""


class Sweeper:
    """Keeps contact intervals by pair and slab of absolute time, so that they hold as the horizon moves on.

    Each pass sweeps the robots that changed, and computes anew only the intervals that an edge of the horizon cuts. The
    result depends on what is on the floor, not on the order or the batches in which it came; but for pairs with one
    robot in a crowd, see `CrowdedPairs`. Dormant robots cost nothing but a box a second each.
    """

    def __init__(
        self,
        *,
        clearance_m: float,
        horizon_s: float = 10.0,
        crowds: Mapping[str, int] = NO_CROWDS,
        claims: Claims | None = None,
        slots: RobotSlots | None = None,
    ) -> None:
        """`crowds` is a number for each robot that is in a crowd, and may change. `touch` the robots that it changes
        for. If more pairs come near each other than a floor can hold, `claims` decide which are examined (see
        `pair_choice`); without them all are. `slots` are those of the robots, and maybe of others; without any
        each robot keeps its slot for good."""
        if not clearance_m >= 0 or not 0 < horizon_s < float("inf"):
            raise ValueError("clearance_m must be at least 0 and horizon_s above 0")
        self._clearance_m, self._horizon_s, self._accuracy_m = clearance_m, horizon_s, ACCURACY_M
        self._crowds, self._crowded_pairs, self._trains = crowds, CrowdedPairs(), Trains()
        self._grow_m, self._slabs = clearance_m / 2 + TOLERANCE_M, ceil(horizon_s) + 1 + AHEAD
        self._choice = PairChoice(claims, self._grow_m)
        self._is_crowded, self._is_cut = np.zeros(0, bool), np.zeros(0, bool)
        """(slots,) whether each body is of a robot in a crowd, and whether a pair of it was left out, in this pass."""
        self.slots = RobotSlots() if slots is None else slots
        self._slot_table = SlotTable(self.slots)
        self._touched: Bools = np.zeros(0, bool)
        """(slots,) whether the robot changed or left since the last pass."""
        self._is_new: Bools = np.zeros(0, bool)
        """(slots,) whether the forecast is new since the last pass."""
        self._is_dormant: Bools = np.zeros(0, bool)
        """(slots,) see `let_sleep`."""
        self._since: Ints = np.zeros(0, np.int64)
        """(slots,) the slab from which on a robot has boxes without a gap."""
        self._covered: Ints = np.zeros(0, np.int64)
        """(slots,) the last slab for which a robot has boxes."""
        self._first_slab = 0
        """First slab of the last pass. If time goes back before it, boxes are missing."""
        self._boxes = SweptBoxes(self._slabs)
        self._rings: Ints = np.arange(2 * self._slabs) % self._slabs
        """The ring rows of successive slabs, twice, so that the rows of any range are a slice."""
        self._intervals: ContactIntervals = np.empty(0, CONTACT_INTERVAL)
        self._box_pairs = self._segment_pairs = self._advanced_pairs = 0

    def update(
        self, keys: Sequence[str], forecasts: Forecasts, widened_m: Floats | None = None
    ) -> tuple[tuple[str, str], ...]:
        """Replace the forecasts of `keys`, one row each. Returns the key and reason of each forecast that can't be
        swept.

        The envelopes are `widened_m` (n,) longer and wider than the robots are; just as long and wide if that is None.

        A robot whose new forecast is invalid is off the floor until its next one: its old forecast no longer holds. If
        a key is there twice, the later row counts.
        """
        if self._trains.concern(keys, forecasts):
            keys, forecasts, widened_m, stale = self._trains.bodies(keys, forecasts, widened_m)
            self._discard(stale)
        found = self._update(keys, forecasts, widened_m)
        trains = {key: self._trains.trailer_keys(key) for key in keys if key in self._trains.trailers}
        self._slot_table.set_trains(trains)
        return found

    def _update(
        self, keys: Sequence[str], forecasts: Forecasts, widened_m: Floats | None
    ) -> tuple[tuple[str, str], ...]:
        if len(set(keys)) == len(keys) and self._replace(keys, forecasts, widened_m):
            return ()
        reasons, newest = faults(forecasts), {key: row for row, key in enumerate(keys)}
        self._discard(key for key, row in newest.items() if row in reasons)
        newest = {key: row for key, row in newest.items() if row not in reasons}
        rows = list(newest.values())
        self._replace(list(newest), forecasts.take(rows), None if widened_m is None else widened_m[rows])
        return tuple((keys[row], reason) for row, reason in sorted(reasons.items()))

    def _replace(self, keys: Sequence[str], forecasts: Forecasts, widened_m: Floats | None) -> bool:
        """Replace the forecasts of `keys`, which are all different. Returns False, and changes nothing, if any forecast
        is invalid."""
        slots = self._slot_table.replace_forecasts(keys, forecasts, 0.0 if widened_m is None else widened_m)
        self._make_room()
        if slots is not None:
            self._touched[slots], self._is_new[slots], self._is_dormant[slots] = True, True, False
        return slots is not None

    def _make_room(self) -> None:
        """Make room for all slots."""
        self._slot_table.make_room()
        for column in (self._touched, self._is_new, self._is_dormant, self._since, self._covered):
            column.resize(len(self.slots), refcheck=False)
        self._boxes.grow(len(self.slots))

    def discard(self, keys: Iterable[str]) -> None:
        """Remove robots from the floor, with their trailers."""
        self._discard(self._trains.discard(keys) if self._trains.trailers else keys)

    def _discard(self, keys: Iterable[str]) -> None:
        left = self._slot_table.discard(keys)
        self._touched[left], self._is_dormant[left] = True, False

    def let_sleep(self, keys: Iterable[str]) -> None:
        """These robots stand until their next forecast. No conflicts are looked for among such robots, which are called
        dormant."""
        slots = self._bodies(keys)
        self._touched[slots] = self._is_dormant[slots] = True

    def touch(self, keys: Iterable[str]) -> None:
        """Look at all pairs of robots again in the next pass."""
        self._touched[self._bodies(keys)] = True

    def _bodies(self, keys: Iterable[str]) -> list[int]:
        """The slots of robots and of their trailers."""
        slots = self.slots.by_uuid
        return [slots[key] for key in self._trains.all_bodies(keys) if key in slots]

    def encounters(self, pairs: Sequence[tuple[str, str]], at_s: Floats) -> Encounters:
        """(n,) of `ENCOUNTER`: how the robots of n pairs meet at these times, with their sizes as reported."""
        slots = self._slot_table.find([*chain.from_iterable(pairs)])
        floor_state = self._slot_table.robots, self._slot_table.knots, self._slot_table.widened_m
        met = encounters(*floor_state, slots, at_s)
        set_places(met, *floor_state, slots.reshape(-1, 2), at_s)
        return met

    def copied(self, keys: Sequence[str]) -> tuple[Robots, Knots]:
        """Copies of the robots of `keys`, of their trailers after them, and of their knots; a robot that is not on the
        floor has no knots."""
        return self._slot_table.copied([*keys, *chain.from_iterable(map(self._trains.trailer_keys, keys))])

    def find_conflicts(self, now_s: float, reach_s: float = inf, accuracy_m: float = 0.0) -> PairConflicts:
        """The conflicts in [`now_s`, `now_s` + horizon], or in a shorter span of `reach_s`.

        `accuracy_m` may make the smallest separations of newly computed pairs coarser than a millimetre. They are never
        too small.
        """
        self._accuracy_m, reach_s = max(accuracy_m, ACCURACY_M), min(reach_s, self._horizon_s)
        self._box_pairs = self._segment_pairs = self._advanced_pairs = 0
        fcl_check, self._choice.left_out = FclCheck(self._clearance_m, TOLERANCE_M), 0
        first_slab, last_slab = floor(now_s), floor(now_s + reach_s)
        is_changed, is_new = self._begin_pass(first_slab)
        self._intervals, changed = still_valid(self._intervals, is_changed, first_slab), np.flatnonzero(is_changed)
        slabs = ceil(reach_s) + 1 + AHEAD
        self._cover_dormant(first_slab, slabs)
        new_pairs, held = [(self._cover_changed(changed, first_slab, slabs), changed)], self._intervals
        new_pairs += self._cover_unchanged(first_slab, last_slab, slabs)
        for pairs, covered in new_pairs:
            intervals = self._intervals_of(pairs, covered, held, fcl_check)
            self._intervals, held = merged(self._intervals, intervals, self.slots.ranks()), held[:0]
        return self._listed(self._within(now_s, now_s + reach_s, fcl_check), now_s, is_new, fcl_check)

    def _begin_pass(self, first_slab: int) -> tuple[Bools, Bools]:
        """(slots,) which robots to cover anew, and which have a new forecast."""
        self._make_room()
        slots = len(self.slots)
        is_changed, is_new = self._touched, self._is_new
        if first_slab < self._first_slab:
            is_changed |= np.maximum(self._since, self._covered - self._slabs + 1) > first_slab
        self._touched, self._is_new, self._first_slab = np.zeros(slots, bool), np.zeros(slots, bool), first_slab
        self._is_cut, self._is_crowded = np.zeros(slots, bool), self._crowd_numbers() > 0
        return is_changed, is_new

    def _cover_changed(self, changed: Ints, first_slab: int, slabs: int) -> Pairs:
        """Cover the changed robots in `slabs` slabs from `first_slab` on. Returns the pairs of boxes to look at."""
        self._since[changed] = first_slab
        self._cover(changed, first_slab, slabs, anew=True)
        return self._overlapping_pairs(changed, first_slab, slabs)

    def _cover_unchanged(self, first_slab: int, last_slab: int, slabs: int) -> list[tuple[Pairs, Ints]]:
        """Cover unchanged robots in the slabs that the horizon has reached. Returns the pairs of boxes to look at, and
        the slots that were covered, of which nothing is held in these slabs."""
        behind = np.flatnonzero((self._covered < last_slab) & ~self._is_dormant)
        return [
            (self._overlapping_pairs(slots, begin, new_slabs), slots)
            for slots, begin, new_slabs in self._extend(behind, first_slab, slabs)
        ]

    def _overlapping_pairs(self, slots: Ints, first_slab: int, slabs: int) -> Pairs:
        rings, marks = self._rings_of(first_slab, slabs), (self._is_crowded, self._is_cut)
        return self._boxes.overlapping_pairs(slots, rings, *marks, self._choice.most_found)

    def _cover_dormant(self, first_slab: int, slabs: int) -> None:
        """Cover dormant robots in all slabs before others are: these find them, so that they need not look."""
        behind = np.flatnonzero((self._covered < first_slab + slabs - 1) & self._is_dormant)
        for _ in self._extend(behind, first_slab, slabs):
            pass

    def _extend(self, behind: Ints, first_slab: int, slabs: int) -> Iterator[tuple[Ints, int, int]]:
        """Cover robots in the slabs that they lack. Gives slots, and the first and the number of their new slabs."""
        behind = self._slot_table.present(behind) if len(behind) else behind
        for covered in sorted(set(self._covered[behind].tolist())):
            slots = behind[self._covered[behind] == covered]
            begin, end = max(covered + 1, first_slab), first_slab + slabs
            if begin > covered + 1:
                self._since[slots] = begin
            self._cover(slots, begin, end - begin)
            yield slots, begin, end - begin

    def _rings_of(self, first_slab: int, slabs: int) -> Ints:
        """The ring rows of `slabs` slabs."""
        first = first_slab % self._slabs
        return self._rings[first : first + slabs]

    def _cover(self, slots: Ints, first_slab: int, slabs: int, *, anew: bool = False) -> None:
        self._covered[slots] = first_slab + slabs - 1
        self._boxes.cover(slots, *self._floor_state()[1:], first_slab, slabs, self._grow_m, anew=anew)

    def _crowd_numbers(self) -> Ints:
        """(slots,) the number of the crowd of each body's robot, 0 for none."""
        crowds = self.slots.column(self._crowds)
        if self._trains.trailers and crowds.any():
            crowds = crowds[pulled_by(self._slot_table.robots[: len(crowds)])]
        return crowds

    def _intervals_of(self, pairs: Pairs, slots: Ints, held: ContactIntervals, fcl_check: FclCheck) -> ContactIntervals:
        """The contact intervals of those of `pairs` in their slabs that are examined, see `PairChoice.examined`."""
        ranks, robots, marks = self.slots.ranks(), self._slot_table.robots, (self._is_crowded, self._is_cut)
        pairs = sorted_pairs(pairs, ranks, robots, self._is_crowded, self._is_dormant)
        pairs = self._choice.examined(pairs, slots, held, self._slot_table, self._boxes.by_ring, marks)
        return intervals_of(pairs, self._contacts(pairs, (-inf, inf), fcl_check), self._boxes.by_ring)

    def cut_robots(self) -> list[str]:
        """The keys of the robots, or trailers, of which a pair was left out in the last pass."""
        return self.slots.names(np.flatnonzero(self._is_cut))

    def _contacts(self, pairs: Pairs, span: Span, fcl_check: FclCheck) -> Contacts:
        """The contact of each pair within `span`. FCL decides what advancement leaves open. Counts the work."""
        boxes, robots, knots = self._floor_state()
        contacts, opened, segment_pairs, advanced = find_contacts(
            pairs, boxes, robots, knots, span, self._clearance_m, TOLERANCE_M, self._accuracy_m, ROUNDS
        )
        self._box_pairs += len(pairs)
        self._segment_pairs += segment_pairs
        self._advanced_pairs += advanced
        if not opened:
            return contacts
        rows = np.flatnonzero((contacts["open"] < inf) & is_shaped(robots, pairs["a"], pairs["b"]))
        if len(rows):
            decisions = ShapeDecisions(self._floor_state(), fcl_check, self._accuracy_m, ROUNDS)
            contacts[rows] = decisions.contacts(pairs[rows], contacts["open"][rows], span)
        for row in np.flatnonzero(contacts["open"] < inf).tolist():
            motions = motions_of(pairs[row : row + 1], boxes, robots, knots, span)
            contact = fcl_check.first_contact(motions, float(contacts["open"][row]))
            separation = smallest_separation(motions, self._accuracy_m) if contact < inf else (inf, inf)
            contacts[row] = (contact, *separation, inf)
        return contacts

    def _floor_state(self) -> FloorState:
        return self._boxes.by_ring, self._slot_table.robots, self._slot_table.knots

    def _within(self, begin_s: float, end_s: float, fcl_check: FclCheck) -> ContactIntervals:
        """The intervals of the horizon. Those that an edge of it cuts are computed anew for the part inside."""
        cut_pairs = np.empty(len(self._intervals), PAIR)
        intervals, cut = in_span(self._intervals, begin_s, end_s, self._slabs, cut_pairs)
        if not len(cut):
            return intervals
        contacts = self._contacts(cut_pairs[: len(cut)], (begin_s, end_s), fcl_check)
        return with_contacts(intervals, cut, contacts, begin_s, end_s)

    def _listed(self, intervals: ContactIntervals, now_s: float, is_new: Bools, fcl_check: FclCheck) -> PairConflicts:
        met = Meetings(*by_pair(intervals, is_new, now_s))
        if self._trains.trailers:
            met = of_trains(met, self._slot_table.robots, self.slots.ranks())
        a, b, contact_s, separation_m, separation_at_s, fresh = met
        if self._crowds:
            rows = self._crowded_pairs.kept_rows(a, b, contact_s, self.slots.column(self._crowds))
            a, b, contact_s, fresh = a[rows], b[rows], contact_s[rows], fresh[rows]
            separation_m, separation_at_s = separation_m[rows], separation_at_s[rows]
        return PairConflicts(
            pairs=tuple(zip(*map(self.slots.names, (a, b)), strict=True)),
            contact_s=contact_s,
            separation_m=separation_m,
            separation_at_s=separation_at_s,
            start_separation_m=self._start_distances(a, b, now_s),
            fresh=fresh,
            box_pairs=self._box_pairs,
            segment_pairs=self._segment_pairs,
            advanced_pairs=self._advanced_pairs,
            fcl_calls=fcl_check.calls,
            left_out=self._choice.left_out,
        )

    def _start_distances(self, a: Ints, b: Ints, now_s: float) -> Floats:
        """See `start_distances`; of shapes the distance of the shapes."""
        robots = self._slot_table.robots
        apart_m = start_distances(a, b, *self._floor_state(), now_s)
        rows = np.flatnonzero(is_shaped(robots, a, b))
        if len(rows):
            any_m = np.full(len(rows), inf)
            apart_m[rows] = shape_distances(a[rows], b[rows], any_m, *self._floor_state(), *SHAPES.arrays, now_s)
        if self._trains.trailers:
            each_a, each_b, row_of = pairs_of_bodies(a, b, robots)
            floor_state = self._floor_state()
            bodies_m = shape_distances(each_a, each_b, apart_m[row_of], *floor_state, *SHAPES.arrays, now_s)
            np.minimum.at(apart_m, row_of, bodies_m)
        return apart_m
