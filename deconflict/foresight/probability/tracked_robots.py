"""The robots that the estimator knows: a slot for each, and what is known of it, in columns."""

from collections.abc import Iterable
from itertools import repeat

import numpy as np

from deconflict.foresight.forecast_errors.track_kernels import ROBOT
from deconflict.foresight.probability.pair_table import codes, slots_of
from deconflict.foresight.rollout.start_samples import key_of
from ingest.batch import Batch, Bools, Floats, Ints, Pair

COLUMNS = "is_used", "has_news", "records", "rank", "half_m", "levels_m", "vendor", "absence", "key"
"""Columns by slot. All grow together."""


class TrackedRobots:
    """Columns by slot, with spare slots. A robot keeps its slot until it is removed; another robot may then get it."""

    def __init__(self) -> None:
        self.slots: dict[str, int] = {}
        self.names: list[str] = []
        """UUID by slot."""
        self.vendor_numbers: dict[str, int] = {}
        self.is_used = np.zeros(0, np.bool_)
        """Whether a robot has the slot."""
        self.has_news = np.zeros(0, np.bool_)
        """Whether the robot has reported since the last look."""
        self.records = np.zeros(0, ROBOT)
        self.rank = np.zeros(0, np.int64)
        """Place of the robot's UUID among all. The two robots of a pair are named in this order."""
        self.half_m = np.zeros((2, 0))
        """(2, slots) half length and half width."""
        self.levels_m = np.zeros((2, 0))
        """(2, slots) bottom and top."""
        self.vendor = np.zeros(0, np.int64)
        """Number of the robot's vendor, see `vendor_numbers`."""
        self.absence = np.zeros(0)
        """Probability that the robot is silent because it is absent."""
        self.key = np.zeros(0, np.int64)
        """See `start_samples.key_of`."""
        self._spare: list[int] = []
        self._is_rank_stale = False

    def __len__(self) -> int:
        """Slots, free ones included."""
        return len(self.records)

    def add(self, batch: Batch) -> Ints:
        """(n,) the slots of the robots of a batch. Robots that are not known get one."""
        slots = np.fromiter(map(self.slots.get, batch.robots, repeat(-1)), np.int64, len(batch))
        for row in np.flatnonzero(slots < 0).tolist():
            slots[row] = self._new_slot(batch.robots[row])
        if self._is_rank_stale:
            self._is_rank_stale = False
            self.rank[[self.slots[name] for name in sorted(self.slots)]] = np.arange(len(self.slots))
        return slots

    def update(self, slots: Ints, batch: Batch) -> None:
        """Store heights and vendors of the robots of a batch, which have these slots."""
        self.has_news[slots] = True
        self.levels_m[:, slots] = batch.forecasts.bottom_m, batch.forecasts.top_m
        numbers = self.vendor_numbers
        self.vendor[slots] = [numbers.setdefault(vendor, len(numbers)) for vendor in batch.vendors]

    def remove(self, uuids: Iterable[str]) -> Ints:
        """Free the slots of robots that have left; (n,) the slots."""
        slots = np.array([self.slots.pop(uuid) for uuid in uuids if uuid in self.slots], np.int64)
        self._spare.extend(slots.tolist())
        self.is_used[slots] = self.has_news[slots] = False
        self.records["surprise"][slots] = self.absence[slots] = 0.0
        self.records["stood_since_s"][slots] = np.inf
        return slots

    def slots_of(self, uuids: Iterable[str]) -> Ints:
        """(n,) the slots of those of `uuids` that are known."""
        return np.array([self.slots[uuid] for uuid in uuids if uuid in self.slots], np.int64)

    def take_news(self) -> Bools:
        """(slots,) which robots have reported since the last call."""
        has_news, self.has_news = self.has_news, np.zeros(len(self.has_news), np.bool_)
        return has_news

    def is_standing(self, slots: slice | Ints) -> Bools:
        """Which robots of `slots` stand, by their forecasts or by their reports."""
        robots = self.records[slots]
        stands: Bools = robots["stays"] | (robots["stood_since_s"] < np.inf)
        return stands

    def pair_code(self, slot: int, other_slot: int) -> int:
        """The code of a pair of slots, given in any order."""
        a, b = (slot, other_slot) if self.rank[slot] < self.rank[other_slot] else (other_slot, slot)
        return int(codes(np.array([a]), np.array([b]))[0])

    def pair_names(self, code: Ints) -> list[Pair]:
        """The UUIDs of each pair of `code` (p,)."""
        name_of, (a, b) = self.names.__getitem__, slots_of(code)
        return list(zip(map(name_of, a.tolist()), map(name_of, b.tolist()), strict=True))

    def pair_vendors(self, code: Ints) -> Ints:
        """(p,) one number for the two vendors of each pair, whatever their order."""
        a, b = (self.vendor[slots] for slots in slots_of(code))
        return codes(np.minimum(a, b), np.maximum(a, b))

    def both_present(self, code: Ints) -> Floats:
        """(p,) the probability that both robots of each pair are present."""
        a, b = slots_of(code)
        both: Floats = (1.0 - self.absence[a]) * (1.0 - self.absence[b])
        return both

    def _new_slot(self, uuid: str) -> int:
        """The slot of a robot, a new one if it has none: a batch may hold a new robot twice."""
        if uuid in self.slots:
            return self.slots[uuid]
        if self._spare:
            slot = self._spare.pop()
            self.names[slot] = uuid
        else:
            slot = len(self.names)
            self.names.append(uuid)
            if slot >= len(self):
                self._grow(max(2 * slot, 16))
        self.slots[uuid], self.is_used[slot], self.key[slot] = slot, True, key_of(uuid)
        self._is_rank_stale = True
        return slot

    def _grow(self, slots: int) -> None:
        more = slots - len(self)
        for name in COLUMNS:
            column = getattr(self, name)
            setattr(self, name, np.concatenate([column, np.zeros((*column.shape[:-1], more), column.dtype)], axis=-1))
        self.records["stood_since_s"][-more:] = np.inf
