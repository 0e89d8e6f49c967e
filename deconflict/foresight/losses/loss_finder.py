"""Finds interactions and losses in reports: which robot gives way to which, and how much time it loses.

Pure: the same reports give the same losses, live and in a replay.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from deconflict.foresight.history_rows import with_rows
from deconflict.foresight.interactions.interaction_finder import Interaction, InteractionFinder
from deconflict.foresight.interactions.progress_kernels import AHEAD_S
from deconflict.foresight.interactions.recent_reports import interaction_reports
from deconflict.foresight.losses.losing import LOSING, ORDER, RESTS, KnownRobots, squares
from deconflict.foresight.losses.loss import NOBODY, Loss, LossKind, kind_of, root_of
from deconflict.foresight.losses.loss_kernels import REFERENCES, lost_times
from deconflict.foresight.losses.travel_states import travel_states
from deconflict.foresight.losses.usual_times import MOST_KINDS, no_usual_times
from deconflict.foresight.motion_assumptions import MOVES_MPS
from deconflict.sweep.robot_slots import lengthen
from ingest.batch import Batch, Bools, Floats, Ints

LEAST_LOST_S = 0.7
"""Smaller losses are left out: forecasts are not as exact."""
PART_S = 60.0
"""A loss that lasts longer is reported in parts of this length."""
CONTINUES_S = 1.0
"""A loss ends if the robot loses nothing for longer than this."""
BY_SLOT = "_names_destinations", "_reports_paths"
BY_ROW = "_states", "_references", "_ways", "_has_way"
"""Arrays by slot, and by the row of a robot that does not rest."""


@dataclass(slots=True, eq=False)
class _OpenLoss:
    """A loss that lasts. Rows stand for robots."""

    by: int
    root: int
    kind: LossKind
    from_s: float
    until_s: float
    floor: int
    x_m: float
    y_m: float
    lost_s: float = 0.0
    over_usual_s: float = 0.0
    is_sure: bool = True


class LossFinder:
    """What is known of the time that each robot loses, by its row in the history of reports (see `HistoryRows`)."""

    def __init__(self) -> None:
        self._interactions = InteractionFinder()
        """It keeps the reports."""
        self._states = np.zeros(0, LOSING)
        self._references = np.zeros((0, REFERENCES, AHEAD_S + 1, 3))
        self._ways = np.zeros((0, AHEAD_S + 1, 3))
        self._has_way = np.zeros(0, np.bool_)
        self._names_destinations = np.zeros(0, np.bool_)
        """Whether a robot has ever named a destination."""
        self._reports_paths = np.zeros(0, np.bool_)
        """Whether a robot has ever reported a path."""
        self._names: dict[int, tuple[str, str, str]] = {}
        """By row, the UUID of the robot, its vendor and its model."""
        self._usual = no_usual_times()
        self._kinds: dict[tuple[str, str], int] = {}
        """By vendor and model, their number in `_usual`."""
        self._open: dict[int, _OpenLoss] = {}
        """By row of the losing robot."""
        self._ended: list[Loss] = []

    def grow(self, slots: int) -> None:
        """Make room for this many slots."""
        self._interactions.grow(slots)
        more = slots - len(self._reports_paths)
        if more > 0:
            lengthen(self, BY_SLOT, more)

    def forget(self, slots: Ints) -> None:
        """Other robots have these slots from now on. Losses of the robots that had them, and to these, end."""
        self._leave(slots)
        self._interactions.forget(slots.tolist())
        self._names_destinations[slots] = self._reports_paths[slots] = False

    def rest(self, slots: Ints) -> list[Interaction]:
        """These robots have been silent for long: losses of them, and to them, end. Returns the interactions that end
        with that."""
        if not len(slots):
            return []
        self._leave(slots)
        ended = self._interactions.rest(slots)
        self._fit()
        return ended

    def _leave(self, slots: Ints) -> None:
        rows = self._interactions.recent.rows.of_slot[slots]
        rows = rows[rows >= 0]
        if not len(rows):
            return
        gone = set(rows.tolist())
        for row in [row for row, loss in self._open.items() if not gone.isdisjoint((row, loss.by, loss.root))]:
            self._end(row)
        for row in gone:
            self._names.pop(row, None)
        self._states["blocker"][np.isin(self._states["blocker"], rows)] = NOBODY
        self._states[rows] = np.zeros((), LOSING)
        self._states["blocker"][rows], self._has_way[rows] = NOBODY, False

    def receive(
        self,
        batch: Batch,
        slots: Ints,
        track: Floats,
        usual_m: Floats,
        half_m: Floats,
        levels_m: Floats,
        vendor: Ints,
        is_crowded: Bools,
    ) -> list[Interaction]:
        """Add the n robots of a batch, which have these slots (n,). Returns the interactions of which they show
        something new; `take` returns the losses.

        `track` and `usual_m` are as in `InteractionReports`. By slot are the half sides `half_m` (2, slots), bottom and
        top `levels_m` (2, slots), the number of the `vendor` (slots,), and whether a robot is in a crowd (slots,): such
        a robot loses nothing, since it isn't where it reports to be.
        """
        reports = interaction_reports(batch, slots, track, usual_m)
        interactions = self._interactions.receive(reports, half_m, levels_m, vendor)
        self._fit()
        rows = self._interactions.recent.rows.of_slot[slots]
        names_destinations, reports_paths = self._names_destinations[slots], self._reports_paths[slots]
        states = travel_states(batch, track[:, : AHEAD_S + 1], names_destinations, reports_paths)
        self._reports_paths[slots] |= states.plans >= ORDER
        self._names_destinations[slots] |= states.has_destination
        self._names.update(zip(rows.tolist(), zip(batch.robots, batch.vendors, batch.models, strict=True), strict=True))
        robots, kinds = self._known(half_m, levels_m, vendor), self._kinds_of(batch)
        goes = np.where(is_crowded[slots], RESTS, states.goes)
        lost = lost_times(
            self._states, self._references, robots, rows, reports.event_s, goes, states.plans, self._usual, kinds
        )  # fmt: skip
        by_row = dict(zip(rows[lost["row"]].tolist(), lost, strict=True))
        for row in rows.tolist():
            if row in by_row or row in self._open:
                self._update(row, by_row.get(row), robots)
        return interactions

    def _kinds_of(self, batch: Batch) -> Ints:
        """(n,) the numbers of vendor and model of its robots. What is usual is forgotten if there are too many."""
        if len(self._kinds) > MOST_KINDS:
            self._usual, self._kinds = no_usual_times(), {}
        models = zip(batch.vendors, batch.models, strict=True)
        return np.array([self._kinds.setdefault(model, len(self._kinds)) for model in models], np.int64)

    def _fit(self) -> None:
        """Have as many rows as the history of reports."""
        rows, before = len(self._interactions.recent.rows), len(self._states)
        if rows != before:
            for name, column in with_rows(self, BY_ROW, rows).items():
                setattr(self, name, column)
            self._states["blocker"][before:] = NOBODY

    def take(self) -> list[Loss]:
        """The losses that have ended since the last call, in the order of time."""
        ended, self._ended = self._ended, []
        return sorted(ended, key=lambda loss: (loss.until_s, loss.robot))

    def _known(self, half_m: Floats, levels_m: Floats, vendor: Ints) -> KnownRobots:
        recent = self._interactions.recent
        slots, newest = recent.rows.slots, np.ascontiguousarray(recent.states["newest"])
        cell = squares(newest, recent.tracks, recent.floor)
        by_cell = np.argsort(cell, kind="stable")
        return KnownRobots(
            newest=newest,
            reports=np.ascontiguousarray(recent.states["reports"]),
            t_s=recent.t_s,
            tracks=recent.tracks,
            floor=recent.floor,
            half_m=half_m.take(slots, axis=1),
            levels_m=levels_m.take(slots, axis=1),
            vendor=vendor[slots],
            ways=self._ways,
            has_way=self._has_way,
            cell=cell[by_cell],
            by_cell=by_cell,
        )

    def _update(self, row: int, lost: Any, robots: KnownRobots) -> None:
        """Continue, begin or end the loss of a robot of a batch. `lost` is of `LOST`, None if it lost nothing."""
        loss = self._open.get(row)
        if lost is None or lost["blocker"] == NOBODY:
            if loss and not self._states["loses"][row]:
                self._end(row)
            return
        if loss and (loss.by != lost["blocker"] or lost["from_s"] > loss.until_s + CONTINUES_S):
            self._end(row)
            loss = None
        if loss is None:
            loss = self._open[row] = self._begin(row, lost, robots)
        loss.until_s, loss.lost_s = float(lost["until_s"]), loss.lost_s + float(lost["lost_s"])
        loss.over_usual_s += float(lost["over_s"])
        loss.is_sure &= bool(lost["is_on_way"])
        if loss.until_s - loss.from_s >= PART_S:
            self._end(row)

    def _begin(self, row: int, lost: Any, robots: KnownRobots) -> _OpenLoss:
        by, from_s = int(lost["blocker"]), float(lost["from_s"])
        root, for_each_other = root_of(self._states["blocker"], row)
        here, other = robots.tracks[row, robots.newest[row], 0], robots.tracks[by, robots.newest[by], 0]
        kind = kind_of(
            other[2] - here[2],
            stands=self._speed_mps(by) < MOVES_MPS,
            waits=self._states["blocker"][by] != NOBODY,
            for_each_other=for_each_other or bool(lost["is_mutual"]),
        )
        floor = int(robots.floor[row, robots.newest[row]])
        return _OpenLoss(by, root, kind, from_s, from_s, floor, float(here[0]), float(here[1]))

    def _speed_mps(self, row: int) -> float:
        """Until the newest report."""
        recent = self._interactions.recent
        return float(recent.speed[row, recent.states["newest"][row]])

    def _end(self, row: int) -> None:
        loss = self._open.pop(row)
        if loss.lost_s < LEAST_LOST_S:
            return
        robot, vendor, model = self._names[row]
        (by, by_vendor, _), (root, root_vendor, _) = self._names[loss.by], self._names[loss.root]
        self._ended.append(
            Loss(
                robot=robot,
                by=by,
                root=root,
                vendor=vendor,
                model=model,
                by_vendor=by_vendor,
                root_vendor=root_vendor,
                kind=loss.kind,
                from_s=loss.from_s,
                until_s=loss.until_s,
                lost_s=round(loss.lost_s, 3),
                over_usual_s=round(max(loss.over_usual_s, 0.0), 3),
                is_sure=loss.is_sure,
                floor=loss.floor,
                x_m=round(loss.x_m, 2),
                y_m=round(loss.y_m, 2),
            )
        )
