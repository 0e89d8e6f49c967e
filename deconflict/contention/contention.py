"""Contention as the engine drives it: batches in, advisory revisions out, a look a second.

Pure: data and the time in, revisions out. Robots are taken in as they change; a look then asks only what can have
changed with them: queues of resources that somebody wants, standing robots that are in somebody's way.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import hypot, inf

from deconflict.advisories.finding_lifecycle import Finding, FindingAdvisory, FindingLifecycle
from deconflict.contention import findings
from deconflict.contention.queues.charger_forecast import Need, Shortage, needs, shortages
from deconflict.contention.queues.dwell_times import Dwells
from deconflict.contention.queues.queue_advice import Advising, advising_alone
from deconflict.contention.queues.queue_forecast import Row, Turns, first_come
from deconflict.contention.queues.zone_flow import Flow
from deconflict.contention.robots.batch_merging import Gathered, Gathering
from deconflict.contention.robots.destinations import Stop
from deconflict.contention.robots.place_geometry import Geometry
from deconflict.contention.robots.robot_table import Robots
from deconflict.contention.robots.robot_view import Seen
from deconflict.contention.waiting.blockages import blockages
from deconflict.contention.waiting.deadlocks import Link, rings
from deconflict.contention.waiting.detours import Refuge
from deconflict.contention.waiting.wait_graph import (
    Around,
    Hindrance,
    Leg,
    aisle_wants,
    hindrances,
    legs,
    place_wants,
    way_wants,
)
from deconflict.runtime.learned_state import Part, numbers
from deconflict.settings.shared_places import ContentionSettings, Resource, Zone
from deconflict.sweep.geometry.heights import heights_overlap, largest_group_at_one_height
from ingest.batch import Batch
from ingest.measures.measures import Measures

LOOK_S = 1.0
NEEDS_S = 10.0
"""Who will need a charger is asked so often."""
REACH_S = 900.0
"""How far ahead demand is forecast (standard 5.2.3)."""
QUEUES_M = 10.0
"""A robot that stands so near a place without room for it waits for the place."""
NOBODY = Turns([], 0, [], [], 0.0, 0)


class Contention:
    """Who will want what, who waits for whom, and who is in the way."""

    def __init__(
        self,
        resources: Iterable[Resource],
        zones: Iterable[Zone],
        settings: ContentionSettings,
        measures: Measures,
        restored: Iterable[FindingAdvisory] = (),
        advising: Callable[[Geometry], Advising] = advising_alone,
    ) -> None:
        self.geometry = Geometry(resources, zones)
        self.robots = Robots(self.geometry)
        self._settings, self._measures = settings, measures
        self._lifecycle = FindingLifecycle(settings.clear_after_s, restored)
        self._dwells = {one.id: Dwells(one) for one in self.geometry.resources.values()}
        self._advising = advising(self.geometry)
        self._flows = {one.id: Flow(one.capacity) for one in self.geometry.zones.values()}
        self._inside: dict[str, set[str]] = {zone: set() for zone in self._flows}
        """By zone, the robots in it at the last look."""
        self._crowds: dict[str, set[str]] = {zone: set() for zone in self._flows}
        """By zone, the most of them that are at one height."""
        self._looked_s = -inf
        self._gathering = Gathering()
        self._rings: list[tuple[Link, ...]] = []
        self._turns: dict[str, Turns] = {}
        self._needs: list[Need] = []
        self._shortages: list[Shortage] = []
        self._needs_s = -inf
        measures.ask(self._measure)

    def open(self) -> list[FindingAdvisory]:
        return self._lifecycle.open()

    @property
    def needs(self) -> Sequence[Need]:
        """Robots that may need a charger and have not said that they come to one, by the last look at that."""
        return self._needs

    @property
    def turns(self) -> Mapping[str, Turns]:
        """Everybody's turn at each place that somebody has or wants, by the last look."""
        return self._turns

    def adopt(self, told: FindingAdvisory) -> None:
        """Go on from a revision that another decided."""
        self._lifecycle.adopt(told)

    def learned(self) -> dict[str, Part]:
        """What is worth keeping over a restart: how wrong arrival times were, and how long robots keep what."""
        self._catch_up()
        stays = {resource: one.learned() for resource, one in self._dwells.items()}
        arrivals = self.robots.arrivals
        late = {"lateness": arrivals.lateness.learned(), "overdue": arrivals.overdue.learned()}
        batteries = self.robots.batteries.learned()
        return {"arrivals": arrivals.learned(), **late, "stays": stays, "batteries": batteries}

    def resume(self, parts: Mapping[str, Part]) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        self.robots.arrivals.resume(parts.get("arrivals", {}))
        self.robots.arrivals.lateness.resume(parts.get("lateness", {}))
        self.robots.arrivals.overdue.resume(parts.get("overdue", {}))
        self.robots.batteries.resume(parts.get("batteries", {}))
        stays = parts.get("stays", {})
        for resource in stays.keys() & self._dwells.keys():
            self._dwells[resource].resume(numbers(stays, resource, (None,)).tolist())

    def receive(self, batch: Batch) -> None:
        """Take in the robots that changed: now, or once there are more of them or somebody asks."""
        for due in self._gathering.put(batch):
            self._take_in(due)

    def _take_in(self, gathered: Gathered) -> None:
        for resource, dwell_s in self.robots.look(gathered):
            self._dwells[resource].left_after(dwell_s)
        self.robots.forget(gathered.batch.gone)

    def _catch_up(self) -> None:
        for due in self._gathering.rest():
            self._take_in(due)

    def step(self, now_s: float) -> list[FindingAdvisory]:
        """The revisions of this look; none between looks."""
        if now_s - self._looked_s < LOOK_S:
            return []
        dt_s = min(now_s - self._looked_s, 10 * LOOK_S)
        self._looked_s = now_s
        self._catch_up()
        passing, around = self.robots.passing(), Around.of(self.robots)
        self._flow(passing, now_s, dt_s)
        journeys = legs(self.robots, around, now_s)
        self._turns = first_come(self._wanted(passing, journeys, now_s), self.geometry, now_s)
        in_way = hindrances(self.robots, around, now_s)
        self._foresee_charging(now_s)
        found = [*self._contended(now_s), *self._short(now_s), *self._doubled(now_s)]
        found += self._locked(passing, journeys, in_way, now_s)
        self._measures.level("deconflict_deadlocks_ahead", {(): len(self._rings)})
        return self._lifecycle.revise(now_s, found, self._party)

    def _party(self, uuid: str) -> tuple[str, str]:
        one = self.robots[uuid]
        return one.name, one.vendor

    def _flow(self, passing: list[Seen], now_s: float, dt_s: float) -> None:
        inside: dict[str, list[Seen]] = {zone: [] for zone in self._flows}
        for one in passing:
            for zone, passage in one.passages.items():
                if passage.enter_s <= now_s < passage.leave_s:
                    inside[zone].append(one)
        for zone, flow in self._flows.items():
            crowd, self._inside[zone] = largest_group_at_one_height(inside[zone]), {one.uuid for one in inside[zone]}
            flow.step(dt_s, len(crowd), len(self._crowds[zone] - self._inside[zone]))
            self._crowds[zone] = {one.uuid for one in crowd}

    def _wanted(self, passing: list[Seen], journeys: list[Leg], now_s: float) -> dict[str, list[Row]]:
        """Who has or will want what, by place."""
        wanted = defaultdict[str, list[Row]](list)
        for one in passing:
            for zone, passage in one.passages.items():
                through_s = min(passage.leave_s, float(passage.t_s[-1]) + LOOK_S) - max(passage.enter_s, now_s)
                coming = one.uuid not in self._inside[zone]
                service_s = max(through_s, 0.0)
                wanted[zone].append(Row(coming, passage.enter_s, one.uuid, service_s, LOOK_S, one.bottom_m, one.top_m))
        for leg in journeys:
            if leg.node[1] == 0 and leg.place in self._dwells:
                wanted[leg.place].append(self._kept(leg, now_s))
        usual_s = {place: one.service_s for place, one in self._dwells.items()}
        for one in self.robots.bound():
            met, last = {one.here}, len(one.stops) - 1
            for number, stop in enumerate(one.stops):
                place = stop.resource
                if place is None or place in met:
                    continue
                met.add(place)
                arrival_s, spread_s = stop.expected_s, stop.spread_s
                if number == 0 and arrival_s > stop.t_s and self._waits(one, stop, wanted.get(place, ())):
                    arrival_s, spread_s = stop.t_s, 0.0
                if arrival_s <= now_s + REACH_S:
                    service_s = _between_s(stop, one.stops[number + 1]) if number < last else usual_s[place]
                    wanted[place].append(Row(True, arrival_s, one.uuid, service_s, spread_s, one.bottom_m, one.top_m))
        return wanted

    def _waits(self, one: Seen, stop: Stop, rows: Iterable[Row]) -> bool:
        """Whether a robot that stands is near its next stop and has no room there yet: that alone holds it up."""
        away_m = hypot(stop.x_m - one.x_m, stop.y_m - one.y_m) if stop.datum == one.datum else inf
        if not one.stands or away_m > QUEUES_M or stop.resource is None:
            return False
        inside = [row for row in rows if not row.coming and heights_overlap(row, one)]
        return len(inside) >= self.geometry.capacity(stop.resource)

    def _kept(self, leg: Leg, now_s: float) -> Row:
        """What a robot has now, for as long as it says, or else as long as robots usually stay."""
        one = self.robots[leg.node[0]]
        left_s = self._dwells[leg.place].remaining_s(now_s - one.came_s)
        if leg.until_s < inf:
            late_s = one.stops[0].expected_s - one.stops[0].t_s
            left_s = leg.until_s + late_s - now_s
        return Row(False, leg.since_s, one.uuid, left_s, 0.0, one.bottom_m, one.top_m)

    def _contended(self, now_s: float) -> Iterable[Finding]:
        """Places where somebody will wait long, with the slots that would cost least."""
        long = self._settings.least_wait_s
        self._advising.begin(now_s)
        for place, turns in self._turns.items():
            if turns.longest_s >= long:
                advice = self._advising.slots(place, self._turns, self.robots, now_s)
                yield findings.contention(self.geometry, place, turns, advice, self.robots, now_s)

    def _foresee_charging(self, now_s: float) -> None:
        """Who will need a charger, and which chargers will be full for that, every now and then."""
        if self.geometry.chargers and now_s - self._needs_s >= NEEDS_S:
            self._needs_s = now_s
            self._needs = needs(self.robots, self.robots.batteries, self.geometry, now_s)
            usual_s = {charger: self._dwells[charger].service_s for charger in self.geometry.chargers}
            standing = [one.chargers[0] for one in self._shortages]
            self._shortages = shortages(self._needs, self._turns, self.geometry, now_s, usual_s, standing)

    def _short(self, now_s: float) -> Iterable[Finding]:
        """Chargers that will be full for robots that have not said that they come; not where some wait as they say."""
        long = self._settings.least_wait_s
        for one in self._shortages:
            waits = any(self._turns[charger].longest_s >= long for charger in one.chargers if charger in self._turns)
            known = self.robots.keys() >= {*one.there, *(need.robot for need in one.needs)}
            if known and not waits and one.wait_s >= long:
                yield findings.shortage(self.geometry, one, self.robots, now_s)

    def _doubled(self, now_s: float) -> Iterable[Finding]:
        """Places with more robots inside than they take."""
        for place, turns in self._turns.items():
            if turns.inside > self.geometry.capacity(place):
                crowd = largest_group_at_one_height(turns.rows[: turns.inside])
                if len(crowd) > self.geometry.capacity(place):
                    yield findings.double_occupancy(self.geometry, place, turns, crowd, now_s)

    def _locked(
        self, passing: list[Seen], journeys: list[Leg], in_way: list[Hindrance], now_s: float
    ) -> Iterable[Finding]:
        """Rings of waits, and blockers of robots that are in none."""
        resources = self.geometry.resources
        aisles = [zone.id for zone in self.geometry.zones.values() if zone.kind == "aisle"]
        wants = place_wants(journeys, {one.id: one.capacity for one in resources.values()})
        self._rings = rings([*wants, *aisle_wants(passing, aisles), *way_wants(in_way)])
        refuges = self._refuges() if self._rings else []
        for ring in self._rings:
            advice = self._advising.way_out(ring, self.robots, refuges, now_s)
            yield findings.deadlock(self.geometry, ring, advice, self.robots, now_s)
        for one in blockages(in_way, self.robots, now_s, self._settings.stand_s):
            yield findings.blockage(one, self.robots, now_s)

    def _refuges(self) -> list[Refuge]:
        """Places with room left where a robot is in nobody's way."""
        free = [
            one.id
            for one in self.geometry.resources.values()
            if one.kind != "lift" and len(self._turns.get(one.id, NOBODY).rows) < one.capacity
        ]
        return [Refuge(place, *self.geometry.middle(place)) for place in free]

    def _measure(self) -> None:
        if self._looked_s == -inf:
            return
        places = [*self._dwells, *self._flows]
        turns = [self._turns.get(place, NOBODY) for place in places]
        levels: dict[str, Mapping[str, float]] = {
            "deconflict_resource_demand": dict(zip(places, [len(one.rows) for one in turns], strict=True)),
            "deconflict_resource_occupancy": dict(zip(places, [one.inside for one in turns], strict=True)),
            "deconflict_resource_wait_seconds": dict(zip(places, [one.longest_s for one in turns], strict=True)),
            "deconflict_resource_expected_demand": self._expected_demand(),
            "deconflict_zone_flow_per_second": {zone: one.flow_per_s for zone, one in self._flows.items()},
            "deconflict_zone_saturation_ratio": {zone: one.saturation for zone, one in self._flows.items()},
            "deconflict_arrival_time_ratio": {
                vendor: self.robots.arrivals.quantiles(vendor)[1] for vendor in self.robots.arrivals.seen()
            },
        }
        self.robots.arrivals.lateness.measure(self._measures)
        for name, series in levels.items():
            self._measures.level(name, {(label,): value for label, value in series.items()})

    def _expected_demand(self) -> dict[str, float]:
        """By charger, how many robots will need it besides those that say so; one that may choose counts in parts."""
        demand = dict.fromkeys(self.geometry.chargers, 0.0)
        for need in self._needs:
            for charger in need.chargers:
                demand[charger] += float(need.likely[-1]) / len(need.chargers)
        return demand


def _between_s(stop: Stop, after: Stop) -> float:
    """How long a robot may keep a stop before it sets out for the next one."""
    return max(after.expected_s - hypot(after.x_m - stop.x_m, after.y_m - stop.y_m) - stop.expected_s, 1.0)
