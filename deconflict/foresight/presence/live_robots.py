"""The robots on the floor: of each its newest batch and its row there."""

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import hypot, inf

import numpy as np

from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.robot_slots import RobotSlots, lengthen
from deconflict_client.participant_kinds import ParticipantKind
from ingest.batch import Basis, Batch, Bools, Floats, Forecasts, Ints
from ingest.kernels import FLOAT, INTS, MATRIX, inner, kernel
from ingest.shapes import shapes_of

LOOSE, LOOSE_SHARE = 32, 8
"""So many robots that were set aside wait until they are moved to one batch, and one more for each of these moved."""
_BASES = tuple(Basis)
_heights_overlap = inner(heights_overlap)


@kernel((MATRIX, INTS, FLOAT))
def _near(at: Floats, members: Ints, within_m: float) -> tuple[Ints, Floats]:
    """The slots of the robots within a distance of one of `members`, at the floor and height of one of them; and the
    distance to the nearest.

    `at` (slots, 5) is x_m, y_m, floor, bottom_m and top_m; nan for a free slot.
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
            beside |= floor == other_floor and _heights_overlap(bottom_m, top_m, other_bottom_m, other_top_m)
        if beside and nearest_m <= within_m:
            slots[n], away_m[n], n = slot, nearest_m, n + 1
    return slots[:n].copy(), away_m[:n].copy()


@dataclass(slots=True, eq=False)
class LiveRobot:
    """One robot on the floor. It stays until a batch says that it is gone: silence alone never removes it."""

    batch: Batch
    """The newest batch that it was in."""
    row: int
    """Its row of that batch."""
    slot: int
    growth_m: float = 0.0
    """How much its uncertainty has grown since its last report."""

    @property
    def vendor(self) -> str:
        return self.batch.vendors[self.row]

    @property
    def source(self) -> str:
        return self.batch.sources[self.row]

    @property
    def model(self) -> str:
        return self.batch.models[self.row]

    @property
    def name(self) -> str:
        return self.batch.names[self.row]

    @property
    def participant(self) -> ParticipantKind:
        return self.batch.participants[self.row]

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
    def reports_within_s(self) -> float:
        return float(self.batch.reports_within_s[self.row])

    @property
    def batch_forecasts(self) -> Forecasts:
        """Forecasts of all robots of its batch, with envelopes as reported."""
        return self.batch.forecasts

    @property
    def forecast(self) -> Forecasts:
        """The forecast of this robot alone."""
        return self.batch_forecasts.single(self.row)

    @property
    def widened_m(self) -> float:
        """How much longer and wider than reported its envelope is swept."""
        return 2 * (self.doubt_m + self.growth_m)


@dataclass(slots=True, eq=False)
class LiveRobots:
    """All robots on all floors."""

    robots: dict[str, LiveRobot] = field(default_factory=dict)
    floors: tuple[str, ...] = ()
    on_foot: set[str] = field(default_factory=set)
    """UUIDs of those that are people on foot."""
    at: Floats = field(default_factory=lambda: np.empty((0, 5)))
    """(slots, 5) x_m, y_m and floor of the first knot, bottom_m and top_m; nan for a free slot."""
    event_s: Floats = field(default_factory=lambda: np.empty(0))
    """(slots,) when each robot was where it reported to be."""
    sizes_m: Floats = field(default_factory=lambda: np.empty((0, 2)))
    """(slots, 2) length and width as reported."""
    vendor: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    """(slots,) the number of the vendor."""
    source: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    """(slots,) the number of the source, see `Batch.sources`."""
    came_s: Floats = field(default_factory=lambda: np.empty(0))
    """(slots,) since when each robot is known, see `Batch.came_s`: a restart of the engine does not change it."""
    crowd: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    """(slots,) the number of the crowd that each robot is in, see `Crowds`; 0 if none."""
    crowded_s: Floats = field(default_factory=lambda: np.empty(0))
    """(slots,) when each robot of a crowd was last found in it."""
    _is_changed: Bools = field(default_factory=lambda: np.empty(0, np.bool_))
    """(slots,) whether a robot has come or reported since the last `take_changed`."""
    slots: RobotSlots = field(default_factory=RobotSlots)
    """Of these robots, and of those that others go on knowing. They are not freed here."""
    _aside: set[str] = field(default_factory=set)
    """Robots that were set aside and have not reported since."""
    _loose: int = 0
    """How many of them may still be in the batch of their last report."""
    _vendor_numbers: dict[str, int] = field(default_factory=dict)
    _source_numbers: dict[str, int] = field(default_factory=dict)

    def update(self, batch: Batch) -> list[str]:
        """Replace what is known of the robots of a batch. Returns the UUIDs of new robots."""
        self.floors, forecasts = batch.floors, batch.forecasts
        self._aside.difference_update(batch.robots)
        slots, _ = self.slots.assign(batch.robots)
        new_rows = [row for row, uuid in enumerate(batch.robots) if uuid not in self.robots]
        self.make_room()
        for row in new_rows:
            uuid = batch.robots[row]
            self.robots[uuid] = LiveRobot(batch, row, int(slots[row]))
        for row, uuid in enumerate(batch.robots):
            robot = self.robots[uuid]
            robot.batch, robot.row, robot.growth_m = batch, row, 0.0
        self.on_foot.difference_update(batch.robots)
        self.on_foot.update(on_foot(batch))
        first = forecasts.start[:-1]
        places = [column[first] for column in (forecasts.x_m, forecasts.y_m, forecasts.floor)]
        self.at[slots] = np.column_stack([*places, forecasts.bottom_m, forecasts.top_m])
        self.sizes_m[slots, 0], self.sizes_m[slots, 1] = forecasts.length_m, forecasts.width_m
        self.event_s[slots], self._is_changed[slots] = batch.event_s, True
        self.came_s[slots[new_rows]] = np.minimum(batch.came_s[new_rows], batch.now_s)
        self.crowd[slots[new_rows]] = 0
        self.vendor[slots] = _numbered(batch.vendors, self._vendor_numbers)
        self.source[slots] = _numbered(batch.sources, self._source_numbers)
        return list(dict.fromkeys(batch.robots[row] for row in new_rows))

    def make_room(self) -> None:
        """Make room for all slots."""
        if len(self.slots) > len(self.at):
            more = max(len(self.slots), 64)
            self.at = np.concatenate([self.at, np.full((more, self.at.shape[1]), np.nan)])
            numbers = "vendor", "source", "crowd", "_is_changed"
            lengthen(self, ("event_s", "sizes_m", "came_s", "crowded_s", *numbers), more)

    def set_aside(self, uuids: Iterable[str]) -> None:
        """These robots will not report for long: move them to a batch of their own, so that their last batches need not
        be kept with all the other robots in them."""
        new = self.robots.keys() & uuids
        self._aside |= new
        self._loose += len(new)
        if self._loose < LOOSE + len(self._aside) // LOOSE_SHARE:
            return
        self._loose, aside = 0, [self.robots[uuid] for uuid in sorted(self._aside)]
        rows_of: dict[int, list[LiveRobot]] = {}
        for robot in aside:
            rows_of.setdefault(id(robot.batch), []).append(robot)
        parts = [
            replace(robots[0].batch.take(np.array([robot.row for robot in robots])), floors=self.floors, claims=())
            for robots in rows_of.values()
        ]
        batch = Batch.joined(parts)
        for row, robot in enumerate(robot for robots in rows_of.values() for robot in robots):
            robot.batch, robot.row = batch, row

    def take_changed(self) -> Ints:
        """(n,) the slots of the robots that have come or reported since the last call."""
        changed = np.flatnonzero(self._is_changed)
        self._is_changed[changed] = False
        return changed

    def remove(self, uuids: Iterable[str]) -> None:
        """Forget robots. Unknown ones are ignored."""
        uuids = list(uuids)
        self._aside.difference_update(uuids)
        self.on_foot.difference_update(uuids)
        left = [robot.slot for uuid in uuids if (robot := self.robots.pop(uuid, None))]
        self.at[left], self.crowd[left] = np.nan, 0

    def forecasts(self, uuids: Iterable[str]) -> tuple[list[str], Forecasts]:
        """Those of `uuids` that are on the floor, in that order, and their forecasts."""
        present = [uuid for uuid in uuids if uuid in self.robots]
        return present, _joined([self.robots[uuid] for uuid in present])

    def group_with_nearest(
        self, group: set[str], within_m: float, most: int, without: Container[str] = ()
    ) -> list[str]:
        """The UUIDs of a group and of at most `most` other robots, the nearest to any of the group within a distance,
        on its floor and at its height; ascending. Those in `without` are not among the others."""
        slots, away_m = _near(self.at, np.array([self.robots[uuid].slot for uuid in group], np.int64), within_m)
        others = [
            (distance_m, uuid)
            for distance_m, uuid in zip(away_m.tolist(), self.slots.names(slots), strict=True)
            if uuid not in group and uuid not in without
        ]
        if len(others) > most:
            others = sorted(others)[:most]
        return sorted(group.union(uuid for _, uuid in others))


def on_foot(batch: Batch) -> Iterable[str]:
    """The UUIDs of the people on foot of a batch."""
    return (uuid for uuid, kind in zip(batch.robots, batch.participants, strict=True) if kind == "person")


def _numbered(names: Iterable[str], numbers: dict[str, int]) -> list[int]:
    """The number of each name; a new one gets the next number."""
    return [numbers.setdefault(name, len(numbers)) for name in names]


def _joined(robots: Sequence[LiveRobot]) -> Forecasts:
    """The forecasts of robots, in that order. Mostly they are a few robots of many batches."""
    if not robots:
        return Forecasts.empty()
    spans = [
        (robot.batch_forecasts, slice(*robot.batch_forecasts.start[robot.row : robot.row + 2].tolist()))
        for robot in robots
    ]
    return Forecasts(
        start=np.concatenate([[0], np.cumsum([span.stop - span.start for _, span in spans])]),
        t_s=np.concatenate([forecasts.t_s[span] for forecasts, span in spans]),
        x_m=np.concatenate([forecasts.x_m[span] for forecasts, span in spans]),
        y_m=np.concatenate([forecasts.y_m[span] for forecasts, span in spans]),
        yaw_rad=np.concatenate([forecasts.yaw_rad[span] for forecasts, span in spans]),
        floor=np.concatenate([forecasts.floor[span] for forecasts, span in spans]),
        length_m=np.array([robot.batch_forecasts.length_m[robot.row] for robot in robots]),
        width_m=np.array([robot.batch_forecasts.width_m[robot.row] for robot in robots]),
        bottom_m=np.array([robot.batch_forecasts.bottom_m[robot.row] for robot in robots]),
        top_m=np.array([robot.batch_forecasts.top_m[robot.row] for robot in robots]),
        shapes=shapes_of([robot.batch_forecasts.shape(robot.row) for robot in robots]),
    )
