"""One engine's share of the floors: it hears its tiles and what lies around them, and tells of what is its own.

The rule of ownership: an advisory is told by whoever owns the tile in which it was raised, at the place where the two
envelopes first come within the clearance, from then until it is cleared. Every engine that sees both robots judges
them alike, so exactly one finds that place in a tile of its own; the others keep the same advisory in silence, take
what the owner told for their own, and go on with it where the tile becomes theirs. A near miss is counted by whoever
owns the tile in which the first of its robots was heard last.
"""

from collections import Counter, OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from deconflict.advisories.advisory_counts import (
    ADVISORY_METRICS,
    NEAR_MISSES,
    count_by_severity,
    count_revisions,
    set_open_count,
)
from deconflict.advisory import AdvisoryState, ConflictAdvisory
from deconflict.cluster.tiles.channels import GONE, Extents, Floors, channel, late, wide_channel
from deconflict.cluster.tiles.tiles import Area, Grid, Place, Tile
from deconflict.engine.engine import Engine
from deconflict.foresight.presence.presence import PROBABLY_LEFT_ROBOTS, SILENCES
from deconflict.settings.site import Site
from ingest.batch import Batch, Bools, Ints, Pair
from ingest.measures.measures import Measures

PATIENCE_S = 10.0
"""How long an advisory of a tile that was taken over waits for its robots to be heard."""
REMEMBERED = 100_000
"""Of so many advisories it is known which revision was told last."""


class Told(NamedTuple):
    """A revision as it is told, with the place that decides who tells it."""

    home: Place
    advisory: ConflictAdvisory


def judging(site: Site) -> Site:
    """The site of an engine that judges conflicts alone: what robots share is watched over by one for all."""
    return site.model_copy(update={"resources": (), "zones": ()})


class Shard:
    """Pure, as the engine is: parcels in, revisions of its own out."""

    def __init__(self, engine: Engine, grid: Grid, reach_m: float) -> None:
        self.engine, self.area = engine, Area(grid, ())
        self.loads: Counter[Tile] = Counter()
        """Statuses by tile, since who reads it cleared it."""
        self._told = Measures()
        """Of the advisories and near misses that are its own; the engine counts those too that are others'."""
        self._grid, self._reach_m = grid, reach_m
        self._around = {GONE}
        """The channels of its tiles and of what is around them."""
        self._floors = Floors()
        self._arrived_s: dict[str, float] = {}
        """When the newest status of each robot here arrived."""
        self._homes: dict[str, Place] = {}
        """By advisory that is open here or anywhere."""
        self._open: dict[Pair, Told] = {}
        """As told last."""
        self._revisions: OrderedDict[str, int] = OrderedDict()
        """The last revision of each advisory that was told."""
        self._news: set[Pair] = set()
        """Pairs of which another has told since the last step."""
        self._awaited_s: dict[Pair, float] = {}
        """Until when the robots of an advisory of this shard are waited for."""
        self._due: list[Told] = []

    def renew(self, engine: Engine, reach_m: float) -> None:
        """Go on with an engine that knows what was open, yet to hear of every robot."""
        self.engine, self._reach_m = engine, reach_m
        self._around = {GONE, *self._channels(self.area.roots_near(reach_m))}
        self._floors, self._arrived_s = Floors(), {}

    def own(self, tiles: Iterable[Tile]) -> None:
        """Own these tiles from now on; what is open in them here and was not told yet is told with the next step."""
        self.area = Area(self._grid, tiles)
        self._around = {GONE, *self._channels(self.area.roots_near(self._reach_m))}
        for one in self.engine.conflicts():
            home, told = self._homes.get(one.id), self._revisions.get(one.id, 0)
            if home and home in self.area and one.revision > told:
                state = one.state if told else AdvisoryState.RAISED
                due = one.model_copy(update={"revision": told + 1, "state": state})
                self.engine.adopt(due)
                self._due.append(Told(home, due))
                self._remember(self._due[-1])

    def hears(self) -> set[str]:
        """The channels of its tiles, of what is around them, and of where the robots of its advisories are."""
        places = set[Place]()
        for told in self._mine():
            where = told.advisory.location
            places |= {Place(where.datum, where.x, where.y), *self._places(told.advisory.robots)}
        return self._around.union(*(self._channels(self._grid.roots_near(place, self._reach_m)) for place in places))

    def _channels(self, roots: Iterable[Tile]) -> set[str]:
        return {name for root in roots for name in (channel(root), wide_channel(root.datum))}

    def receive(self, batches: Sequence[Batch]) -> Batch | None:
        """Take in parcels of the channels it hears, in order of arrival; the robots in its own tiles, if any came."""
        if not batches:
            return None
        batches = [self._floors.renumbered(one) for one in batches]
        batch = Batch.joined([replace(one, floors=batches[-1].floors) for one in batches])
        rows = np.flatnonzero(~late(batch, self._arrived_s))
        kept = rows[self._near(batch, rows)]
        stay = {batch.robots[row] for row in kept.tolist()}
        left = [batch.robots[row] for row in rows.tolist() if batch.robots[row] not in stay]
        gone = [*left, *(uuid for uuid in batch.gone if self._forgotten(uuid, batch.now_s))]
        known = tuple(dict.fromkeys(uuid for uuid in gone if uuid in self.engine.live.robots))
        own = self._counted(batch, kept)
        self.engine.receive(batch.take(kept, known))
        self._arrived_s.update((batch.robots[row], float(batch.arrival_s[row])) for row in kept.tolist())
        for uuid in known:
            self._arrived_s.pop(uuid, None)
        return own

    def step(self, now_s: float) -> list[Told]:
        """The revisions that are this shard's to tell."""
        self._align(now_s)
        due, self._due = self._due, []
        for one in self.engine.step(now_s):
            if not isinstance(one, ConflictAdvisory):
                continue
            home = self._homes.setdefault(one.id, Place(one.location.datum, one.location.x, one.location.y))
            if one.state is AdvisoryState.CLEARED and one.robots not in self._open:
                del self._homes[one.id]
            if home in self.area:
                due.append(Told(home, one))
                self._remember(due[-1])
        near = self._places(a for a, _ in self.engine.near_misses)
        self._told.count(NEAR_MISSES, by=sum(place in self.area for place in near))
        count_revisions(self._told, [told.advisory for told in due])
        set_open_count(self._told, count_by_severity(told.advisory for told in self._mine()))
        return due

    def measured(self) -> list[dict[str, Any]]:
        """`Measures.as_document()` of its engine and of what it told; silences are counted where all are heard."""
        engine = self.engine.measures.as_document()
        by_others = (*ADVISORY_METRICS, NEAR_MISSES, SILENCES, PROBABLY_LEFT_ROBOTS)
        values = {name: rows for name, rows in engine["values"].items() if name not in by_others}
        return [engine | {"values": values}, self._told.as_document()]

    def hear(self, told: Told, *, overruled: bool = False) -> None:
        """Take in a revision that was told, its own too; `overruled` where another's stands in place of its own."""
        one = told.advisory
        if one.revision <= self._revisions.get(one.id, 0) and not overruled:
            return
        self._remember(told)
        if one.state is AdvisoryState.CLEARED:
            self.engine.adopt(one)
        else:
            self._news.add(one.robots)

    def _remember(self, told: Told) -> None:
        one = told.advisory
        self._revisions[one.id] = one.revision
        self._revisions.move_to_end(one.id)
        if len(self._revisions) > max(REMEMBERED, 2 * len(self._open)):
            self._revisions.popitem(last=False)
        before = self._open.get(one.robots)
        if before and before.advisory.id != one.id and one.state is not AdvisoryState.CLEARED:
            self._homes.pop(before.advisory.id, None)
        if one.state is not AdvisoryState.CLEARED:
            self._homes[one.id], self._open[one.robots] = told.home, told
            return
        self._homes.pop(one.id, None)
        if before and before.advisory.id == one.id:
            del self._open[one.robots]
            self._awaited_s.pop(one.robots, None)
            self._news.discard(one.robots)

    def _align(self, now_s: float) -> None:
        """Go on with what others told, where both robots are here; with its own also where they are awaited in vain."""
        here = {one.robots: one for one in self.engine.conflicts()}
        live = self.engine.live.robots
        for pair, told in self._open.items():
            known = here.get(pair)
            same = known is not None and known.id == told.advisory.id
            if known == told.advisory or (same and pair not in self._news):
                continue
            if known or live.keys() >= set(pair) or self._waited(told, now_s):
                self.engine.adopt(told.advisory)
                self._news.discard(pair)

    def _waited(self, told: Told, now_s: float) -> bool:
        if told.home not in self.area:
            self._awaited_s.pop(told.advisory.robots, None)
            return False
        return now_s >= self._awaited_s.setdefault(told.advisory.robots, now_s + PATIENCE_S)

    def _mine(self) -> list[Told]:
        return [told for told in self._open.values() if told.home in self.area]

    def _places(self, robots: Iterable[str]) -> Iterable[Place]:
        live = self.engine.live.robots
        for forecast in (live[uuid].forecast for uuid in robots if uuid in live):
            floor = int(forecast.floor[0])
            if floor >= 0:
                yield Place(self._floors.names[floor], float(forecast.x_m[0]), float(forecast.y_m[0]))

    def _near(self, batch: Batch, rows: Ints) -> Bools:
        """(m,) whether each of `rows` can matter here."""
        part = batch.take(rows)
        extents = Extents.of(part, self.engine.site.conflict)
        near = np.zeros(len(part), bool)
        for number, datum in enumerate(part.floors):
            on = np.flatnonzero(extents.floor == number)
            at, low, high = extents.at[on], extents.low[on], extents.high[on]
            near[on] = self.area.within(datum, at, at, self._reach_m)
            near[on] |= self.area.within(datum, low, high, extents.slack_m[on])
        followed = {uuid for told in self._mine() for uuid in told.advisory.robots}
        near |= np.array([uuid in followed for uuid in part.robots], bool)
        return near

    def _forgotten(self, uuid: str, now_s: float) -> bool:
        """Whether nobody has heard of a robot that one ingest forgot."""
        return now_s - self._arrived_s.get(uuid, now_s) > self.engine.site.reading.forget_after_s

    def _counted(self, batch: Batch, rows: Ints) -> Batch:
        """Those of `rows` that are in its tiles, their statuses counted."""
        own = []
        for row in rows[batch.statuses[rows] > 0].tolist():
            knot = batch.forecasts.start[row]
            floor = int(batch.forecasts.floor[knot])
            x_m, y_m = float(batch.forecasts.x_m[knot]), float(batch.forecasts.y_m[knot])
            tile = self.area.tile_of(Place(batch.floors[floor], x_m, y_m)) if floor >= 0 else None
            if tile:
                self.loads[tile] += int(batch.statuses[row])
                own.append(row)
        return batch.take(np.array(own, np.int64))
