"""The channels on which an ingest sends robots: each robot goes to the channel of its tile.

A robot that has left a tile is sent once more to the channel of that tile, so that no engine keeps it. A robot that may
come further within the horizon than engines listen goes to its whole floor. One channel has all robots.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from math import ceil
from typing import NamedTuple, Self
from urllib.parse import quote

import numpy as np

from deconflict.cluster.tiles.tiles import Grid, Tile
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import Conflict
from ingest.batch import Batch, Bools, Floats, FloorPoint, Forecasts, Ints

GONE = "gone"
"""The channel of forgotten robots, which all engines receive."""
EVERY = "every"
"""The channel of all robots of all floors, once each."""
CANARIES = "canaries"
"""The channel of all canaries, which all engines receive."""
LEAD_S = 3.0
"""An engine receives a robot this long before its conflicts matter. The looks that confirm a conflict take as long."""
MOST_BYTES = 1 << 19
"""Largest parcel. By default NATS servers accept messages of up to a mebibyte."""
BODY_M = 5.0
"""Part of an engine's reach for envelopes, clearance and uncertainty."""
BAND_M = 1.0
"""A robot may be this far beside its forecast."""


def reach_m(fastest_mps: float, conflict: Conflict) -> float:
    """How far around its tiles an engine listens: as far as the fastest robot gets in the horizon and the lead."""
    return ceil(fastest_mps * (conflict.horizon_s + LEAD_S) + BODY_M)


def channel(tile: Tile) -> str:
    """The channel of a tile of the grid."""
    return f"{subject_token(tile.datum)}.{tile.column}.{tile.row}"


def wide_channel(datum: str) -> str:
    """The channel of a whole floor."""
    return f"{subject_token(datum)}.wide"


def outdated(batch: Batch, arrived_s: Mapping[str, float]) -> Bools:
    """(n,) whether a newer status of each robot has come already, over another channel."""
    known_s = np.array([arrived_s.get(uuid, -np.inf) for uuid in batch.robots])
    return batch.arrival_s < known_s


def parcels_of(batch: Batch) -> list[bytes]:
    """A batch as parcels that a server accepts, in order; a single parcel unless the batch is large."""
    parcel = batch.to_bytes()
    if len(parcel) <= MOST_BYTES or len(batch) < 2:
        return [parcel]
    rows = np.arange(len(batch))
    halves = batch.take(rows[: len(rows) // 2], batch.gone), batch.take(rows[len(rows) // 2 :])
    return [piece for half in halves for piece in parcels_of(half)]


@lru_cache(1 << 12)
def subject_token(name: str) -> str:
    """A name as one part of a subject."""
    return quote(name, safe="").replace(".", "%2E")


@dataclass(frozen=True, slots=True, eq=False)
class RobotExtents:
    """Where the robots of a batch are and may be. Arrays are (n, 2) unless said otherwise, metres."""

    at: Floats
    """The first knot of each forecast: x and y in the floor's frame."""
    low: Floats
    """The lower corner of the box around all its knots."""
    high: Floats
    """The upper corner of that box."""
    slack_m: Floats
    """(n,) how far from its knots a robot may be in conflict: envelope, trailers, clearance and uncertainty."""
    floor: Ints
    """(n,) index of the floor on which the forecast begins; -1 for none."""

    @classmethod
    def of(cls, batch: Batch, conflict: Conflict) -> "RobotExtents":
        forecasts, begins = batch.forecasts, batch.forecasts.start[:-1]
        knots = np.column_stack([forecasts.x_m, forecasts.y_m])
        half_m = reaches_m(forecasts)
        grown_m = np.sqrt(2.0) * (batch.doubt_m + conflict.silent_growth_limit_m)
        none = not len(batch)
        return cls(
            knots[begins],
            knots if none else np.minimum.reduceat(knots, begins),
            knots if none else np.maximum.reduceat(knots, begins),
            half_m + grown_m + conflict.apart_m + BAND_M,
            forecasts.floor[begins],
        )

    def beyond(self, reach_m: float) -> Bools:
        """(n,) whether a robot may be in conflict further from its place than a reach."""
        away_m = np.hypot(*np.maximum(self.at - self.low, self.high - self.at).T)
        return away_m + self.slack_m > reach_m


def reaches_m(forecasts: Forecasts) -> Floats:
    """(n,) how far each robot and its trailers reach from the centre of its envelope."""
    half_m: Floats = np.hypot(forecasts.length_m, forecasts.width_m) / 2
    for row, shape in enumerate(() if forecasts.shapes is None else forecasts.shapes):
        if shape is not None and shape.trailers:
            half_m[row] = shape.reach_m(float(half_m[row]))
    return half_m


@dataclass(slots=True, eq=False)
class ChannelSorter:
    """Sorts batches of one ingest by channel."""

    grid: Grid
    conflict: Conflict
    reach_m: float
    """How far around its tiles an engine listens."""
    _last: dict[str, Tile] = field(default_factory=dict)
    """The last tile of each robot."""
    _spans: dict[str, "TileSpan"] = field(default_factory=dict)
    """The tiles in which each robot may be in conflict."""

    @classmethod
    def of(cls, settings: Cluster, conflict: Conflict) -> Self:
        """A sorter that has seen no robot yet."""
        return cls(Grid(settings.tile_m), conflict, reach_m(settings.fastest_mps, conflict))

    def renew(self, conflict: Conflict, reach_m: float) -> None:
        """Sort by other settings from now on."""
        self.conflict, self.reach_m = conflict, reach_m

    def roots(self) -> set[Tile]:
        """The tiles of the grid in which any robot is or may be in conflict."""
        spans = set(self._spans.values())
        return {Tile(span.datum, *cell) for span in spans for cell in product(span.columns, span.rows)}

    def sort(self, batch: Batch) -> dict[str, Batch]:
        """The part of a batch for each channel. A robot on no known floor goes to the channel of its last tile."""
        rows: dict[str, list[int]] = {}
        extents = RobotExtents.of(batch, self.conflict)
        wide = extents.beyond(self.reach_m).tolist()
        where = zip(batch.robots, extents.floor.tolist(), extents.at.tolist(), wide, strict=True)
        spans = self._cells(extents)
        for row, (uuid, floor, (x_m, y_m), is_wide) in enumerate(where):
            channels = {channel(self._last[uuid])} if uuid in self._last else set()
            self._forget(uuid)
            if 0 <= floor < len(batch.floors):  # engines refuse and count a floor that is not listed
                datum = batch.floors[floor]
                tile = self._last[uuid] = self.grid.root(FloorPoint(datum, x_m, y_m))
                west, south, east, north = spans[row]
                self._spans[uuid] = TileSpan(datum, range(west, east + 1), range(south, north + 1))
                channels |= {channel(tile), *([wide_channel(datum)] if is_wide else [])}
            for name in channels:
                rows.setdefault(name, []).append(row)
        for uuid in batch.gone:
            self._forget(uuid)
        parts = {name: batch.take(np.array(chosen)) for name, chosen in sorted(rows.items())}
        gone = {GONE: batch.take(np.zeros(0, np.int64), batch.gone)} if batch.gone else {}
        return parts | gone | ({EVERY: batch} if len(batch) or batch.gone or batch.claims else {})

    def _forget(self, uuid: str) -> None:
        self._last.pop(uuid, None)
        self._spans.pop(uuid, None)

    def _cells(self, extents: RobotExtents) -> list[list[int]]:
        """For each robot the first column and row, and the last, in which it may be in conflict, within the reach."""
        slack_m = extents.slack_m[:, None]
        low = np.maximum(extents.low - slack_m, extents.at - self.reach_m)
        high = np.minimum(extents.high + slack_m, extents.at + self.reach_m)
        return np.floor(np.column_stack([low, high]) / self.grid.side_m).astype(np.int64).tolist()


class TileSpan(NamedTuple):
    """A rectangle of tiles."""

    datum: str
    columns: range
    rows: range
