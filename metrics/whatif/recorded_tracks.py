"""What a log says of its robots: where each was at each report, and the time that it lost to others."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from deconflict.foresight.losses.loss import Loss
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.settings.site import Site
from ingest.batch import Batch, Floats, Ints
from ingest.frames.floor_numbers import FloorNumbers
from ingest.measures.measures import Measures
from ingest.recording.log_reader import Event
from metrics.replay.recorded_passes import PassReader

Report = tuple[float, float, float, float, int]
"""Seconds since the epoch, x, y, yaw and floor."""


@dataclass(frozen=True, slots=True, eq=False)
class RobotTrack:
    """The reports of one robot. Arrays are (k,), by time."""

    uuid: str
    name: str
    vendor: str
    model: str
    is_person: bool
    length_m: float
    width_m: float
    t_s: Floats
    """After the start of the log."""
    x_m: Floats
    """Envelope centre, in the floor's frame."""
    y_m: Floats
    yaw_rad: Floats
    floor: Ints


@dataclass(frozen=True, slots=True, eq=False)
class RecordedFloor:
    """A log as the demand is derived from it."""

    tracks: list[RobotTrack]
    losses: list[Loss]
    """Times are after the start of the log."""
    floors: tuple[str, ...]
    """Ids of the floors by index."""
    span_s: float


@dataclass(slots=True, eq=False)
class _Reports:
    """The reports of one robot so far."""

    name: str
    vendor: str
    model: str
    size_m: tuple[float, float]
    is_person: bool = False
    rows: list[Report] = field(default_factory=list)


class TrackReader:
    """Collects tracks and losses from the batches of a log."""

    def __init__(self, site: Site) -> None:
        conflict = site.conflict
        self._foresight = ProbabilityEstimator(conflict.clearance_m, conflict.apart_m, conflict.horizon_s, Measures())
        self._numbers = FloorNumbers(Measures())
        self._reports: dict[str, _Reports] = {}
        self._losses: list[Loss] = []

    def add(self, batch: Batch) -> None:
        batch = self._numbers.renumbered(batch)
        self._foresight.receive(batch)
        self._losses += self._foresight.losses.take()
        known = batch.forecasts
        for row in np.flatnonzero(batch.statuses > 0).tolist():
            knot, uuid = int(known.start[row]), batch.robots[row]
            size_m = float(known.length_m[row]), float(known.width_m[row])
            of_robot = self._reports.setdefault(uuid, _Reports("", "", "", size_m))
            of_robot.name, of_robot.vendor, of_robot.model = batch.names[row], batch.vendors[row], batch.models[row]
            of_robot.size_m, of_robot.is_person = size_m, batch.participants[row] == "person"
            place = float(known.x_m[knot]), float(known.y_m[knot]), float(known.yaw_rad[knot]), int(known.floor[knot])
            of_robot.rows.append((float(batch.event_s[row]), *place))

    def floor(self) -> RecordedFloor:
        """What was collected."""
        times_s = [row[0] for reports in self._reports.values() for row in reports.rows]
        start_s, end_s = (min(times_s), max(times_s)) if times_s else (0.0, 0.0)
        tracks = [_track(uuid, found, start_s) for uuid, found in sorted(self._reports.items())]
        losses = [loss._replace(from_s=loss.from_s - start_s, until_s=loss.until_s - start_s) for loss in self._losses]
        return RecordedFloor(tracks, losses, self._numbers.names, end_s - start_s)


def recorded_floor(events: Iterable[Event], site: Site) -> RecordedFloor:
    """The tracks and losses of a log."""
    passes, reader = PassReader(site), TrackReader(site)
    for engine_pass in chain(passes.passes_of(events), passes.last_passes()):
        reader.add(engine_pass.batch)
    return reader.floor()


def _track(uuid: str, reports: _Reports, start_s: float) -> RobotTrack:
    rows = np.array(sorted({row[0]: row for row in reports.rows}.values()))
    t_s, x_m, y_m, yaw_rad = rows[:, :4].T
    return RobotTrack(
        uuid=uuid,
        name=reports.name,
        vendor=reports.vendor,
        model=reports.model,
        is_person=reports.is_person,
        length_m=reports.size_m[0],
        width_m=reports.size_m[1],
        t_s=t_s - start_s,
        x_m=x_m,
        y_m=y_m,
        yaw_rad=np.unwrap(yaw_rad),
        floor=rows[:, 4].astype(np.int64),
    )
