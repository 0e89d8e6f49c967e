"""What the engine knows of each robot: its newest row of a batch."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import hypot, inf

import numba
import numpy as np

from ingest.batch import Basis, Batch, Floats, Forecasts, Ints
from ingest.kernels import kernel

_BASES = tuple(Basis)
_FLOATS, _INTS = numba.float64[::1], numba.int64[::1]


@kernel(numba.types.Tuple((_INTS, _FLOATS))(numba.float64[:, ::1], _INTS, numba.float64))  # type: ignore[no-untyped-call]
def _near(at: Floats, members: Ints, within_m: float) -> tuple[Ints, Floats]:
    """The slots of robots so near to one of `members`, on the floor of one of them and neither above nor below it, and
    how far it is to the nearest.

    `at` (slots, 5) is x_m, y_m, floor, bottom_m and top_m; nan where there is no robot.
    """
    own = at[members]
    west, south, east, north = inf, inf, -inf, -inf
    for x_m, y_m, _, _, _ in own:
        west, south, east, north = min(west, x_m), min(south, y_m), max(east, x_m), max(north, y_m)
    slots, away_m, n = np.empty(len(at), np.int64), np.empty(len(at)), 0
    for slot in range(len(at)):
        x_m, y_m, floor, bottom_m, top_m = at[slot]
        if not (west - within_m <= x_m <= east + within_m and south - within_m <= y_m <= north + within_m):
            continue
        nearest_m, beside = inf, False
        for other_x_m, other_y_m, other_floor, other_bottom_m, other_top_m in own:
            nearest_m = min(nearest_m, hypot(x_m - other_x_m, y_m - other_y_m))
            beside |= floor == other_floor and bottom_m <= other_top_m and other_bottom_m <= top_m
        if beside and nearest_m <= within_m:
            slots[n], away_m[n], n = slot, nearest_m, n + 1
    return slots[:n].copy(), away_m[:n].copy()


@dataclass(slots=True, eq=False)
class LiveRobot:
    """One robot on the floor, until it is said to be gone: silence alone never removes it."""

    batch: Batch
    """The newest that it was in."""
    row: int
    slot: int
    growth_m: float = 0.0
    """How far its uncertainty has grown since it fell quiet."""

    @property
    def vendor(self) -> str:
        return self.batch.vendors[self.row]

    @property
    def model(self) -> str:
        return self.batch.models[self.row]

    @property
    def name(self) -> str:
        return self.batch.names[self.row]

    @property
    def basis(self) -> Basis:
        return _BASES[int(self.batch.basis[self.row])]

    @property
    def event_s(self) -> float:
        return float(self.batch.event_s[self.row])

    @property
    def doubt_m(self) -> float:
        return float(self.batch.doubt_m[self.row])

    @property
    def batch_forecasts(self) -> Forecasts:
        """Of all robots of its batch, envelopes as reported."""
        return self.batch.forecasts

    @property
    def forecast(self) -> Forecasts:
        """Of this robot alone."""
        return self.batch_forecasts.single(self.row)

    @property
    def widened_m(self) -> float:
        """How much longer and wider its envelope is swept than it was reported."""
        return 2 * (self.doubt_m + self.growth_m)


@dataclass(slots=True, eq=False)
class LiveRobots:
    """Every robot on every floor."""

    robots: dict[str, LiveRobot] = field(default_factory=dict)
    floors: tuple[str, ...] = ()
    _uuids: list[str] = field(default_factory=list)
    """By slot; "" where it is free."""
    _free: list[int] = field(default_factory=list)
    _at: Floats = field(default_factory=lambda: np.empty((0, 5)))
    """(slots, 5) x_m, y_m and floor of each first knot, bottom_m and top_m; nan where the slot is free."""

    def update(self, batch: Batch) -> list[str]:
        """Replace what is known of the robots of a batch; the UUIDs of those that are new."""
        self.floors, told = batch.floors, batch.forecasts
        slots, new = [], []
        for row, uuid in enumerate(batch.robots):
            one = self.robots.get(uuid)
            if one is None:
                new.append(uuid)
                one = self.robots[uuid] = LiveRobot(batch, row, self._slot(uuid))
            else:
                one.batch, one.row, one.growth_m = batch, row, 0.0
            slots.append(one.slot)
        first = told.start[:-1]
        places = [column[first] for column in (told.x_m, told.y_m, told.floor)]
        self._at[slots] = np.column_stack([*places, told.bottom_m, told.top_m])
        return new

    def remove(self, uuids: Iterable[str]) -> None:
        """Forget robots; those that are not known are no error."""
        for uuid in uuids:
            robot = self.robots.pop(uuid, None)
            if robot is not None:
                self._uuids[robot.slot], self._at[robot.slot] = "", np.nan
                self._free.append(robot.slot)

    def forecasts(self, uuids: Iterable[str]) -> tuple[list[str], Forecasts]:
        """The forecasts of those of `uuids` that are on the floor, in that order, and whose they are."""
        keys = [uuid for uuid in uuids if uuid in self.robots]
        return keys, _gathered([self.robots[uuid] for uuid in keys])

    def group_with_nearest(self, group: set[str], within_m: float, most: int) -> list[str]:
        """The robots of a group and the nearest to any of them, on its floor and at its height, in ascending order."""
        slots, away_m = _near(self._at, np.array([self.robots[uuid].slot for uuid in group], np.int64), within_m)
        named = [self._uuids[slot] for slot in slots.tolist()]
        others = [one for one in zip(away_m.tolist(), named, strict=True) if one[1] not in group]
        if len(others) > most:
            named = [uuid for _, uuid in sorted(others)[:most]]
        return sorted(group.union(named))

    def _slot(self, uuid: str) -> int:
        if self._free:
            slot = self._free.pop()
            self._uuids[slot] = uuid
            return slot
        slot = len(self._uuids)
        self._uuids.append(uuid)
        if slot == len(self._at):
            self._at = np.concatenate([self._at, np.full((max(slot, 64), self._at.shape[1]), np.nan)])
        return slot


def _gathered(robots: Sequence[LiveRobot]) -> Forecasts:
    """Their forecasts, in that order: mostly of a few robots of many batches."""
    if not robots:
        return Forecasts.empty()
    spans = [(one.batch_forecasts, slice(*one.batch_forecasts.start[one.row : one.row + 2].tolist())) for one in robots]
    return Forecasts(
        start=np.concatenate([[0], np.cumsum([span.stop - span.start for _, span in spans])]),
        t_s=np.concatenate([told.t_s[span] for told, span in spans]),
        x_m=np.concatenate([told.x_m[span] for told, span in spans]),
        y_m=np.concatenate([told.y_m[span] for told, span in spans]),
        yaw_rad=np.concatenate([told.yaw_rad[span] for told, span in spans]),
        floor=np.concatenate([told.floor[span] for told, span in spans]),
        length_m=np.array([one.batch_forecasts.length_m[one.row] for one in robots]),
        width_m=np.array([one.batch_forecasts.width_m[one.row] for one in robots]),
        bottom_m=np.array([one.batch_forecasts.bottom_m[one.row] for one in robots]),
        top_m=np.array([one.batch_forecasts.top_m[one.row] for one in robots]),
    )
