"""What ingest tells to whom: each robot on the channel of the tile it is in.

A robot that has left a tile is told of once more on that tile's channel, so that nobody keeps it where it is not. One
that may get further in the horizon than engines listen is told of to all of its floor. One channel has everybody.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from math import ceil
from typing import NamedTuple
from urllib.parse import quote

import numpy as np

from deconflict.cluster.tiles.tiles import Grid, Place, Tile
from deconflict.settings.site import Conflict
from ingest.batch import Batch, Bools, Floats, Ints

GONE = "gone"
"""The channel of robots that were forgotten, which everybody hears."""
EVERY = "every"
"""The channel of all robots of all floors, once each."""
LEAD_S = 3.0
"""How long before a robot can matter an engine hears of it: as long as the looks take that confirm a conflict."""
MOST_BYTES = 1 << 19
"""Of a parcel: NATS servers take a message of a mebibyte unless they are told otherwise."""
BODY_M = 5.0
"""What of an engine's reach is left for envelopes, clearance and doubt."""
BAND_M = 1.0
"""How far beside its forecast a robot may be met."""


def reach_m(fastest_mps: float, conflict: Conflict) -> float:
    """How far around its tiles an engine listens: as far as the fastest robot gets in the horizon, and that lead."""
    return ceil(fastest_mps * (conflict.horizon_s + LEAD_S) + BODY_M)


def channel(tile: Tile) -> str:
    """Of a tile of the grid."""
    return f"{token(tile.datum)}.{tile.column}.{tile.row}"


def wide_channel(datum: str) -> str:
    """Of a whole floor."""
    return f"{token(datum)}.wide"


def late(batch: Batch, arrived_s: Mapping[str, float]) -> Bools:
    """(n,) whether a newer status of each robot has come already, by another way."""
    known_s = np.array([arrived_s.get(uuid, -np.inf) for uuid in batch.robots])
    found: Bools = batch.arrival_s < known_s
    return found


def pieces(batch: Batch) -> list[bytes]:
    """A batch as parcels that a server takes, in order; it is one unless it is large."""
    parcel = batch.to_bytes()
    if len(parcel) <= MOST_BYTES or len(batch) < 2:
        return [parcel]
    rows = np.arange(len(batch))
    halves = batch.take(rows[: len(rows) // 2], batch.gone), batch.take(rows[len(rows) // 2 :])
    return [piece for half in halves for piece in pieces(half)]


def token(name: str) -> str:
    """A name as one part of a subject."""
    return quote(name, safe="").replace(".", "%2E")


@dataclass(frozen=True, slots=True, eq=False)
class Extents:
    """Where the robots of a batch are and may be. Arrays are (n, 2) unless said otherwise, metres."""

    at: Floats
    low: Floats
    """Corners of the box of all the knots of a forecast."""
    high: Floats
    slack_m: Floats
    """(n,) how far from its knots a robot may be met, by its envelope, clearance and doubt."""
    floor: Ints
    """(n,) index of where the forecast begins."""

    @classmethod
    def of(cls, batch: Batch, conflict: Conflict) -> "Extents":
        forecasts, begins = batch.forecasts, batch.forecasts.start[:-1]
        knots = np.column_stack([forecasts.x_m, forecasts.y_m])
        half_m = np.hypot(forecasts.length_m, forecasts.width_m) / 2
        grown_m = np.sqrt(2.0) * (batch.doubt_m + conflict.silent_growth_limit_m)
        none = not len(batch)
        return cls(
            knots[begins],
            knots if none else np.minimum.reduceat(knots, begins),
            knots if none else np.maximum.reduceat(knots, begins),
            half_m + grown_m + conflict.clearance_m + conflict.clear_margin_m + BAND_M,
            forecasts.floor[begins],
        )

    def beyond(self, reach_m: float) -> Bools:
        """(n,) whether a robot may be met further from where it is than a reach."""
        away_m = np.hypot(*np.maximum(self.at - self.low, self.high - self.at).T)
        beyond: Bools = away_m + self.slack_m > reach_m
        return beyond


@dataclass(slots=True, eq=False)
class Sorter:
    """Sorts batches of one ingest by channel."""

    grid: Grid
    conflict: Conflict
    reach_m: float
    _last: dict[str, Tile] = field(default_factory=dict)
    """The tile in which each robot was."""
    _spans: dict[str, "Span"] = field(default_factory=dict)

    def renew(self, conflict: Conflict, reach_m: float) -> None:
        """Sort by other settings from now on."""
        self.conflict, self.reach_m = conflict, reach_m

    def roots(self) -> set[Tile]:
        """The tiles of the grid in which a robot is or may be met."""
        spans = set(self._spans.values())
        return {Tile(one.datum, *cell) for one in spans for cell in product(one.columns, one.rows)}

    def sort(self, batch: Batch) -> dict[str, Batch]:
        """The part of a batch for each channel that has one. A robot on no floor is told of where it was before."""
        rows: dict[str, list[int]] = {}
        extents = Extents.of(batch, self.conflict)
        wide = extents.beyond(self.reach_m).tolist()
        where = zip(batch.robots, extents.floor.tolist(), extents.at.tolist(), wide, strict=True)
        spans = self._cells(extents)
        for row, (uuid, floor, (x_m, y_m), is_wide) in enumerate(where):
            told = {channel(self._last[uuid])} if uuid in self._last else set()
            self._forget(uuid)
            if floor >= 0:
                datum = batch.floors[floor]
                tile = self._last[uuid] = self.grid.root(Place(datum, x_m, y_m))
                west, south, east, north = spans[row]
                self._spans[uuid] = Span(datum, range(west, east + 1), range(south, north + 1))
                told |= {channel(tile), *([wide_channel(datum)] if is_wide else [])}
            for one in told:
                rows.setdefault(one, []).append(row)
        for uuid in batch.gone:
            self._forget(uuid)
        parts = {one: batch.take(np.array(chosen)) for one, chosen in sorted(rows.items())}
        gone = {GONE: batch.take(np.zeros(0, np.int64), batch.gone)} if batch.gone else {}
        return parts | gone | ({EVERY: batch} if len(batch) or batch.gone or batch.claims else {})

    def _forget(self, uuid: str) -> None:
        self._last.pop(uuid, None)
        self._spans.pop(uuid, None)

    def _cells(self, extents: Extents) -> list[list[int]]:
        """By robot the first and last column and row where it may be met, no further than engines listen."""
        slack_m = extents.slack_m[:, None]
        low = np.maximum(extents.low - slack_m, extents.at - self.reach_m)
        high = np.minimum(extents.high + slack_m, extents.at + self.reach_m)
        cells: list[list[int]] = np.floor(np.column_stack([low, high]) / self.grid.side_m).astype(np.int64).tolist()
        return cells


class Span(NamedTuple):
    """A rectangle of tiles."""

    datum: str
    columns: range
    rows: range


@dataclass(slots=True, eq=False)
class Floors:
    """One numbering of floors for batches of several ingests."""

    names: list[str] = field(default_factory=list)
    _numbers: dict[str, int] = field(default_factory=dict)

    def renumbered(self, batch: Batch) -> Batch:
        """The batch with floors numbered as here."""
        for name in batch.floors:
            if name not in self._numbers:
                self._numbers[name] = len(self.names)
                self.names.append(name)
        number = np.array([*(self._numbers[name] for name in batch.floors), -1])
        return replace(
            batch,
            floors=tuple(self.names),
            forecasts=replace(batch.forecasts, floor=number[batch.forecasts.floor]),
            destinations=replace(batch.destinations, floor=number[batch.destinations.floor]),
        )
