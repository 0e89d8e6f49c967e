"""One engine's share of the floors: it receives the robots in and around its tiles, and publishes its own advisories.

The rule of ownership: the owner of a tile publishes the advisories with their home in the tile, from raised to cleared.
The home is the place where the two envelopes first come within the clearance, as predicted when the advisory was
raised. Every engine that sees both robots predicts the same, so exactly one engine owns the home. The others keep the
same advisory without publishing it, adopt the owner's revisions, and publish it themselves once the tile is theirs.

The owner of the tile in which the first robot of a near miss last reported counts the near miss.
"""

from collections import Counter, OrderedDict, defaultdict
from collections.abc import Iterable, Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np

from deconflict.advisories.advisory_counts import (
    ADVISORY_METRICS,
    NEAR_MISSES,
    count_by_severity,
    count_revisions,
    set_open_count,
)
from deconflict.cluster.tiles.tile_channels import GONE, RobotExtents, channel, outdated, wide_channel
from deconflict.cluster.tiles.tiles import Area, Grid, Tile
from deconflict.engine.engine import Engine
from deconflict.engine.engine_metrics import LOST_SECONDS
from deconflict.engine.load_shedding import Effort
from deconflict.foresight.presence.presence import PROBABLY_LEFT_ROBOTS, SILENCES
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from ingest.batch import Batch, Bools, FloorPoint, Ints, Pair
from ingest.measures.measures import Measures

ROBOTS_TIMEOUT_S = 10.0
"""An advisory of a tile that was taken over waits this long for reports of its robots."""
REMEMBERED = 100_000
"""Number of advisories whose last revision is remembered."""


class ShardRevision(NamedTuple):
    """A revision and its home, whose owner publishes it."""

    home: FloorPoint
    advisory: ConflictAdvisory


def conflicts_only_site(site: Site) -> Site:
    """The site without resources and zones, which the global judge handles."""
    return site.model_copy(update={"resources": (), "zones": ()})


class Shard:
    """Pure, like the engine: takes in parcels, gives its own revisions."""

    def __init__(self, engine: Engine, grid: Grid, reach_m: float) -> None:
        self.engine, self.area = engine, Area(grid, ())
        self.heard: set[str] | None = None
        """The robots on which it publishes, while nothing is known of others; None for all."""
        self._hears_all_s = inf
        """When it publishes on all robots again."""
        self.loads: Counter[Tile] = Counter()
        """Number of statuses by tile. The reader replaces it."""
        self._measures = Measures()
        """Of its own advisories and near misses. The engine's measures count those of other shards too."""
        self._grid, self._reach_m = grid, reach_m
        self._tile_channels = {GONE}
        """The channels of its tiles and of the tiles around them."""
        self._arrived_s: dict[str, float] = {}
        """When the newest status of each robot here arrived."""
        self._homes: dict[str, FloorPoint] = {}
        """By id of each advisory that is open in any shard."""
        self._open: dict[Pair, ShardRevision] = {}
        """The last published revision of each open advisory of any shard."""
        self._own: dict[Pair, ShardRevision] = {}
        """Those of them that this shard publishes."""
        self._revisions: OrderedDict[str, int] = OrderedDict()
        """The number of the last published revision of each advisory."""
        self._updated: set[Pair] = set()
        """Pairs with a revision of another shard since the last step."""
        self._wait_until_s: dict[Pair, float] = {}
        """Until when an advisory of this shard waits for reports of its robots."""
        self._hears_less = False
        """Whether robots may be left over from channels that it needs no more."""
        self._due: list[ShardRevision] = []
        """Revisions of advisories that came with a new tile, to publish at the next step."""

    def renew(self, engine: Engine, reach_m: float) -> None:
        """Use another engine, which has the open advisories but no robots yet."""
        self.engine, self._reach_m = engine, reach_m
        self._tile_channels = {GONE, *self._channels_of(self.area.roots_near(reach_m))}
        self._arrived_s = {}

    def set_tiles(self, tiles: Iterable[Tile]) -> None:
        """Own these tiles from now on. The next step publishes open advisories in them that nobody has published."""
        self.area = Area(self._grid, tiles)
        self._own = {pair: revision for pair, revision in self._open.items() if revision.home in self.area}
        self._tile_channels = {GONE, *self._channels_of(self.area.roots_near(self._reach_m))}
        self._forget_distant()
        for conflict in self.engine.conflicts():
            home, published = self._homes.get(conflict.id), self._revisions.get(conflict.id, 0)
            if home and home in self.area and conflict.revision > published:
                state = conflict.state if published else AdvisoryState.RAISED
                due = conflict.model_copy(update={"revision": published + 1, "state": state})
                self.engine.adopt(due)
                self._due.append(ShardRevision(home, due))
                self._remember(self._due[-1])

    def channels(self) -> set[str]:
        """The channels that it needs: of its tiles, of the tiles around, and of where its advisories' robots are."""
        places = set[FloorPoint]()
        for revision in self._own.values():
            where = revision.advisory.location
            places |= {FloorPoint(where.datum, where.x, where.y), *self._places(revision.advisory.robots)}
        return self._tile_channels | self._channels_of(self._grid.roots_near(places, self._reach_m))

    def _channels_of(self, roots: Iterable[Tile]) -> set[str]:
        return {name for root in roots for name in (channel(root), wide_channel(root.datum))}

    def receive(self, batches: Sequence[Batch]) -> Batch | None:
        """Take in parcels of its channels, in order of arrival. Returns the robots in its own tiles, if any came."""
        if not batches:
            return None
        batch = self.engine.floors.joined(batches)
        rows = np.flatnonzero(~outdated(batch, self._arrived_s))
        kept = rows[self._is_near(batch, rows)]
        stay = {batch.robots[row] for row in kept.tolist()}
        left = [batch.robots[row] for row in rows.tolist() if batch.robots[row] not in stay]
        off = set(batch.off_floor)
        gone = [*left, *(uuid for uuid in batch.gone if uuid in off or self._is_forgotten(uuid, batch.now_s))]
        known = tuple(dict.fromkeys(uuid for uuid in gone if uuid in self.engine.live.robots))
        own = self._own_rows(batch, kept)
        if self.heard is not None and self._hears_all_s < inf:
            self.heard |= stay
        self.engine.receive(batch.take(kept, known))
        self._arrived_s.update((batch.robots[row], float(batch.arrival_s[row])) for row in kept.tolist())
        for uuid in known:
            self._arrived_s.pop(uuid, None)
        return own

    def step(self, now_s: float, effort: Effort = Effort.FULL) -> list[ShardRevision]:
        """Run the engine, with no more work than `effort` allows. Returns the revisions that this shard publishes."""
        if self._hears_less:
            self._forget_distant()
        self._adopt_updates(now_s)
        due, self._due = self._due, []
        for revision in self.engine.step(now_s, effort):
            if not isinstance(revision, ConflictAdvisory):
                continue
            where = revision.location
            home = self._homes.setdefault(revision.id, FloorPoint(where.datum, where.x, where.y))
            if revision.state is AdvisoryState.CLEARED and revision.robots not in self._open:
                del self._homes[revision.id]
            if home in self.area and (self.heard is None or self.heard.issuperset(revision.robots)):
                due.append(ShardRevision(home, revision))
                self._remember(due[-1])
        near = self._places(a for a, _ in self.engine.near_misses)
        self._measures.count(NEAR_MISSES, by=sum(place in self.area for place in near))
        count_revisions(self._measures, [revision.advisory for revision in due])
        set_open_count(self._measures, count_by_severity(revision.advisory for revision in self._own.values()))
        return due

    def measures(self) -> list[dict[str, Any]]:
        """`Measures.as_document()` of its engine and of its own advisories.

        Leaves out silences, which the global judge counts, and losses, which `ShardLosses` counts.
        """
        engine = self.engine.measures.as_document()
        by_others = (*ADVISORY_METRICS, NEAR_MISSES, SILENCES, PROBABLY_LEFT_ROBOTS, LOST_SECONDS)
        values = {name: rows for name, rows in engine["values"].items() if name not in by_others}
        return [engine | {"values": values}, self._measures.as_document()]

    def distrusted(self) -> list[str]:
        """The robots in its own tiles whose motion contradicts their forecasts."""
        distrusted = self.engine.foresight.distrusted()
        return [uuid for uuid in distrusted if any(place in self.area for place in self._places((uuid,)))]

    def adopt(self, revision: ShardRevision, *, overruled: bool = False) -> None:
        """Take in a published revision, which may be its own. `overruled` if it stands in place of its own."""
        advisory = revision.advisory
        if advisory.revision <= self._revisions.get(advisory.id, 0) and not overruled:
            return
        self._remember(revision)
        if advisory.state is AdvisoryState.CLEARED:
            self.engine.adopt(advisory)
        else:
            self._updated.add(advisory.robots)

    def _remember(self, revision: ShardRevision) -> None:
        advisory = revision.advisory
        pair, is_open = advisory.robots, advisory.state is not AdvisoryState.CLEARED
        self._revisions[advisory.id] = advisory.revision
        self._revisions.move_to_end(advisory.id)
        if len(self._revisions) > max(REMEMBERED, 2 * len(self._open)):
            self._revisions.popitem(last=False)
        before = self._open.get(pair)
        if before and before.advisory.id != advisory.id and is_open:
            self._homes.pop(before.advisory.id, None)
        if is_open:
            self._homes[advisory.id], self._open[pair] = revision.home, revision
            self._own.pop(pair, None)
            if revision.home in self.area:
                self._own[pair] = revision
            return
        self._homes.pop(advisory.id, None)
        if before and before.advisory.id == advisory.id:
            del self._open[pair]
            self._hears_less |= self._own.pop(pair, None) is not None
            self._wait_until_s.pop(pair, None)
            self._updated.discard(pair)

    def _adopt_updates(self, now_s: float) -> None:
        """Have the engine adopt published advisories whose robots are both here, or have not come in time."""
        here = {conflict.robots: conflict for conflict in self.engine.conflicts()}
        live = self.engine.live.robots
        for pair, revision in self._open.items():
            known = here.get(pair)
            same = known is not None and known.id == revision.advisory.id
            if known is revision.advisory or known == revision.advisory or (same and pair not in self._updated):
                continue
            if known or live.keys() >= set(pair) or self._has_waited(revision, now_s):
                self.engine.adopt(revision.advisory)
                self._updated.discard(pair)

    def _has_waited(self, revision: ShardRevision, now_s: float) -> bool:
        """Whether an advisory of this shard has waited long enough for its robots."""
        if revision.advisory.robots not in self._own:
            self._wait_until_s.pop(revision.advisory.robots, None)
            return False
        return now_s >= self._wait_until_s.setdefault(revision.advisory.robots, now_s + ROBOTS_TIMEOUT_S)

    def _places(self, robots: Iterable[str]) -> Iterable[FloorPoint]:
        live = self.engine.live.robots
        for forecast in (live[uuid].forecast for uuid in robots if uuid in live):
            floor = int(forecast.floor[0])
            if floor >= 0:
                yield FloorPoint(self.engine.floors.names[floor], float(forecast.x_m[0]), float(forecast.y_m[0]))

    def _is_near(self, batch: Batch, rows: Ints) -> Bools:
        """(m,) whether each of `rows` may be in conflict in its tiles, or is in one of its advisories."""
        part = batch.take(rows)
        extents = RobotExtents.of(part, self.engine.site.conflict)
        near = np.zeros(len(part), bool)
        for number, datum in enumerate(part.floors):
            on = np.flatnonzero(extents.floor == number)
            at, low, high = extents.at[on], extents.low[on], extents.high[on]
            near[on] = self.area.within(datum, at, at, self._reach_m)
            near[on] |= self.area.within(datum, low, high, extents.slack_m[on])
        involved = {uuid for revision in self._own.values() for uuid in revision.advisory.robots}
        near |= np.array([uuid in involved for uuid in part.robots], bool)
        return near

    def hear_only(self, robots: set[str] | None, now_s: float) -> None:
        """Publish only on these robots, which may become more. Once it is None: on others too as soon as they are
        heard, and after `ROBOTS_TIMEOUT_S` on all."""
        if robots is not None:
            self.heard, self._hears_all_s = robots, inf
        elif self.heard is not None:
            self._hears_all_s = min(self._hears_all_s, now_s + ROBOTS_TIMEOUT_S)
            self.heard = None if now_s >= self._hears_all_s else self.heard

    def _forget_distant(self) -> None:
        """Forget the robots of which this shard hears no more, from tiles that it gave away or an advisory that ended.
        They would count as silent, also once the tile is its own again."""
        self._hears_less = False
        rows = defaultdict[int, list[int]](list)
        batches = {id(robot.batch): robot.batch for robot in self.engine.live.robots.values()}
        for robot in self.engine.live.robots.values():
            rows[id(robot.batch)].append(robot.row)
        near = set[str]()
        for number, batch in batches.items():
            chosen = np.array(rows[number])
            near.update(batch.robots[row] for row in chosen[self._is_near(batch, chosen)].tolist())
        distant = tuple(self.engine.live.robots.keys() - near)
        if distant:
            nobody = next(iter(batches.values())).take(np.zeros(0, np.int64), distant)
            self.engine.receive(nobody)
            for uuid in distant:
                self._arrived_s.pop(uuid, None)

    def _is_forgotten(self, uuid: str, now_s: float) -> bool:
        """Whether a robot that one ingest has forgotten has reported to no other since."""
        return now_s - self._arrived_s.get(uuid, now_s) > self.engine.site.reading.forget_after_s

    def _own_rows(self, batch: Batch, rows: Ints) -> Batch:
        """Those of `rows` that are in its tiles. Counts their statuses."""
        own = []
        for row in rows[batch.statuses[rows] > 0].tolist():
            knot = batch.forecasts.start[row]
            floor = int(batch.forecasts.floor[knot])
            x_m, y_m = float(batch.forecasts.x_m[knot]), float(batch.forecasts.y_m[knot])
            tile = self.area.tile_of(FloorPoint(batch.floors[floor], x_m, y_m)) if floor >= 0 else None
            if tile:
                self.loads[tile] += int(batch.statuses[row])
                own.append(row)
        return batch.take(np.array(own, np.int64))
