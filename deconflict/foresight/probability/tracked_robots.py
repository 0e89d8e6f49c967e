"""The robots that the estimator knows: a slot for each, and what is known of it, in columns."""

from collections import deque
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors.track_kernels import (
    ROBOT,
    Looks,
    RelativePoses,
    ReportHistory,
    relative_poses,
)
from deconflict.foresight.forecast_errors.trailer_tracks import BodyPairs, TrailerTracks
from deconflict.foresight.probability.pair_table import codes, slots_of
from deconflict.foresight.rollout.start_samples import key_of
from deconflict.foresight.rollout.start_times import CountsForAll, always
from deconflict.sweep.pair_choice import NO_CROWDS
from deconflict.sweep.robot_slots import RobotSlots, lengthen
from deconflict.sweep.shapes.shape_separations import bodies, shape_separations
from deconflict.sweep.shapes.shape_table import SHAPES
from ingest.batch import Batch, Bools, Floats, Ints, Pair
from ingest.kernels import ready


class Sizes(NamedTuple):
    """Of bodies, by row."""

    half_m: Floats
    """(2, bodies) half length and half width."""
    levels_m: Floats
    """(2, bodies) bottom and top."""
    shape: Ints
    """(bodies,) number of the shape, 0 for a rectangle."""


def separations_m(poses: RelativePoses, sizes: Sizes, a: Ints, b: Ints) -> Floats:
    """(n, k + m) distances of the bodies of the rows `a` and `b` (n,) at their relative poses, 0 or less if they
    overlap."""
    half_m, levels_m, shape = sizes
    apart_m = poses.separations_m(half_m.take(a, axis=1), half_m.take(b, axis=1))
    rows = np.flatnonzero((shape[a] > 0) | (shape[b] > 0))
    if len(rows):
        looks = (poses.dx_m[rows], poses.dy_m[rows], poses.yaw_a_rad[rows], poses.yaw_b_rad[rows])
        two = (bodies(shape[side], half_m[:, side], levels_m[:, side]) for side in (a[rows], b[rows]))
        apart_m[rows] = shape_separations(apart_m[rows], looks, *two)
    return apart_m


RESTS_AFTER_S = 60.0
"""A dormant robot that was silent for this long rests. No figure looks further back than half of it."""
COLUMNS = (
    "is_used",
    "has_news",
    "is_dormant",
    "records",
    "half_m",
    "levels_m",
    "shape",
    "vendor",
    "absence",
    "key",
)
"""Columns by slot. All grow together."""


class TrackedRobots:
    """Columns by slot, with spare slots."""

    def __init__(
        self, slots: RobotSlots, crowds: Mapping[str, int] = NO_CROWDS, counts_for_all: CountsForAll = always
    ) -> None:
        """`slots` are those of these robots, and maybe of others; they are not freed here. `crowds` has the robots that
        are in a crowd, and may change."""
        self.slots, self._crowds, self._counts_for_all = slots, crowds, counts_for_all
        self.trailers = TrailerTracks()
        self.vendor_numbers: dict[str, int] = {}
        self._sleeping: deque[tuple[float, Collection[str]]] = deque()
        """When robots fell asleep."""
        self.is_used = np.zeros(0, np.bool_)
        """Whether a robot of this table has the slot."""
        self.has_news = np.zeros(0, np.bool_)
        """Whether the robot has reported since the last look."""
        self.is_dormant = np.zeros(0, np.bool_)
        """Whether the robot stands in silence until it reports."""
        self.records = np.zeros(0, ROBOT)
        self.half_m = np.zeros((2, 0))
        """(2, slots) half length and half width."""
        self.levels_m = np.zeros((2, 0))
        """(2, slots) bottom and top."""
        self.shape = np.zeros(0, np.int64)
        """Number of the robot's shape, 0 for a rectangle."""
        self.vendor = np.zeros(0, np.int64)
        """Number of the robot's vendor, see `vendor_numbers`."""
        self.absence = np.zeros(0)
        """Probability that the robot is silent because it is absent."""
        self.key = np.zeros(0, np.int64)
        """See `start_samples.key_of`."""

    def __len__(self) -> int:
        """Slots, free and spare ones included."""
        return len(self.records)

    @property
    def by_uuid(self) -> dict[str, int]:
        """The slots of the robots that are known."""
        return {self.slots.uuids[slot]: slot for slot in np.flatnonzero(self.is_used).tolist()}

    def add(self, batch: Batch) -> Ints:
        """(n,) the slots of the robots of a batch, which are known from now on."""
        slots, _ = self.slots.assign(batch.robots)
        if len(self.slots) > len(self):
            self._grow(len(self.slots) + len(self.slots) // 8 + 16)
        new = slots[~self.is_used[slots]]
        self.is_used[new], self.key[new] = True, list(map(key_of, self.slots.names(new)))
        return slots

    def update(self, slots: Ints, batch: Batch) -> None:
        """Store shapes, trailers, heights and vendors of the robots of a batch, which have these slots."""
        self.has_news[slots], self.is_dormant[slots] = True, False
        self.shape[slots] = SHAPES.numbers(batch.forecasts)
        self.trailers.add(batch, slots)
        self.levels_m[:, slots] = batch.forecasts.bottom_m, batch.forecasts.top_m
        numbers = self.vendor_numbers
        self.vendor[slots] = [numbers.setdefault(vendor, len(numbers)) for vendor in batch.vendors]

    def remove(self, uuids: Collection[str]) -> Ints:
        """Forget robots that have left; (n,) their slots."""
        slots = self.slots_of(uuids)
        self.trailers.forget(slots.tolist())
        self.is_used[slots] = self.has_news[slots] = self.is_dormant[slots] = False
        self.records["surprise"][slots] = self.absence[slots] = 0.0
        self.records["stood_since_s"][slots] = np.inf
        return slots

    def let_sleep(self, uuids: Collection[str], now_s: float, heard_s: Floats) -> Ints:
        """Let robots sleep that stand in silence; `heard_s` (slots,) is when each was last heard. (n,) the slots of
        those that rest from now on: they sleep, and were not heard for `RESTS_AFTER_S`."""
        if uuids:
            self.is_dormant[self.slots_of(uuids)] = True
            self._sleeping.append((now_s, uuids))
        resting: list[str] = []
        while self._sleeping and self._sleeping[0][0] <= now_s - RESTS_AFTER_S:
            resting += self._sleeping.popleft()[1]
        slots = self.slots_of(sorted(resting))
        return slots[self.is_dormant[slots] & (heard_s[slots] <= now_s - RESTS_AFTER_S)]

    def find(self, uuids: Collection[str]) -> Ints:
        """(n,) the slot of each robot; -1 for one that is not known."""
        slots = self.slots.find(uuids)
        return np.where(np.isin(slots, np.flatnonzero(self.is_used)), slots, -1)

    def slots_of(self, uuids: Collection[str]) -> Ints:
        """(n,) the slots of those of `uuids` that are known."""
        slots = self.find(uuids)
        return slots[slots >= 0]

    def slot_of(self, uuid: str) -> int | None:
        """The slot of a robot; None if it is not known."""
        slot = self.slots.by_uuid.get(uuid, len(self))
        return slot if slot < len(self) and self.is_used[slot] else None

    def relative_poses(self, history: ReportHistory, a: Ints, b: Ints, looks: Looks) -> tuple[RelativePoses, Floats]:
        """The robots of slots `b` (n,) as seen from `a` (n,), and (n, k + m) their distances with their trailers, 0 or
        less if they overlap."""
        poses = relative_poses(history, a, b, *looks)
        apart_m = separations_m(poses, Sizes(self.half_m, self.levels_m, self.shape), a, b)
        rows = np.flatnonzero(self.trailers.are_trains(a) | self.trailers.are_trains(b))
        if len(rows):
            self._approach_by_trailers(apart_m, rows, self.trailers.pairs_of_bodies(history, a[rows], b[rows]), looks)
        return poses, apart_m

    def _approach_by_trailers(self, apart_m: Floats, rows: Ints, bodies: BodyPairs, looks: Looks) -> None:
        """Lower the distances `apart_m` (n, k + m) of the pairs of `rows` to those of their nearest bodies."""
        row_of, trailers = rows[bodies.pair], bodies.trailer_half_m.shape[1]
        robots = bodies.slot[: len(bodies.slot) - trailers]
        half_m = np.concatenate([self.half_m[:, robots], bodies.trailer_half_m], axis=1)
        shape = np.concatenate([self.shape[robots], np.zeros(trailers, np.int64)])
        poses = relative_poses(
            bodies.history, bodies.a, bodies.b, *looks._replace(late_s=ready(looks.late_s[:, row_of]))
        )
        sizes = Sizes(half_m, self.levels_m[:, bodies.slot], shape)
        each_m = separations_m(poses, sizes, bodies.a, bodies.b)
        begins = np.searchsorted(bodies.pair, np.arange(len(rows)))
        apart_m[rows] = np.fmin(apart_m[rows], np.fmin.reduceat(each_m, begins))

    def take_news(self) -> Bools:
        """(slots,) which robots have reported since the last call."""
        has_news, self.has_news = self.has_news, np.zeros(len(self.has_news), np.bool_)
        return has_news

    def is_crowded(self) -> Bools:
        """(slots,) whether each robot is in a crowd."""
        is_crowded = np.zeros(len(self), np.bool_)
        is_crowded[self.slots_of(self._crowds)] = True
        return is_crowded

    def is_standing(self, slots: slice | Ints) -> Bools:
        """Which robots of `slots` stand, by their forecasts or by their reports."""
        robots = self.records[slots]
        return robots["stays"] | (robots["stood_since_s"] < np.inf)

    def pair_code(self, slot: int, other_slot: int) -> int:
        """The code of a pair of slots, given in any order: its robots are named in ascending order."""
        rank = self.slots.ranks()
        a, b = (slot, other_slot) if rank[slot] < rank[other_slot] else (other_slot, slot)
        return int(codes(np.array([a]), np.array([b]))[0])

    def code_of(self, robot: str, other: str) -> int | None:
        """The code of two robots in any order; None if one of them is unknown."""
        slots = [slot for uuid in {robot, other} if (slot := self.slot_of(uuid)) is not None]
        return self.pair_code(*slots) if len(slots) == 2 else None

    def pair_names(self, code: Ints) -> list[Pair]:
        """The UUIDs of each pair of `code` (p,)."""
        a, b = map(self.slots.names, slots_of(code))
        return list(zip(a, b, strict=True))

    def pair_vendors(self, code: Ints) -> Ints:
        """(p,) one number for the two vendors of each pair, whatever their order."""
        a, b = (self.vendor[slots] for slots in slots_of(code))
        return codes(np.minimum(a, b), np.maximum(a, b))

    def count_for_all(self, code: Ints) -> Bools:
        """(p,) whether what is learned of each pair counts for the pairs of all vendors."""
        a, b = slots_of(code)
        counts = np.array(list(map(self._counts_for_all, self.vendor_numbers)), np.bool_)
        return counts[self.vendor[a]] & counts[self.vendor[b]]

    def both_present(self, code: Ints) -> Floats:
        """(p,) the probability that both robots of each pair are present."""
        a, b = slots_of(code)
        return (1.0 - self.absence[a]) * (1.0 - self.absence[b])

    def _grow(self, slots: int) -> None:
        more = slots - len(self)
        lengthen(self, COLUMNS, more, axis=-1)
        self.records["stood_since_s"][-more:] = np.inf
