"""Contention as the engine drives it: batches in, advisory revisions out.

Pure: data and the time in, revisions out. Robots are updated as they change. A look, once a second, asks only what can
have changed with them: queues of places that a robot wants, and standing robots that are in another one's way.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import inf

from deconflict.advisories.finding_lifecycle import Finding, FindingAdvisory, FindingLifecycle, NamedRobot
from deconflict.contention import findings
from deconflict.contention.ordinary.ordinary_waits import OrdinaryBlockages, OrdinaryQueues
from deconflict.contention.queues.charger_forecast import (
    ChargerShortage,
    ChargingNeed,
    charger_shortages,
    charging_needs,
)
from deconflict.contention.queues.dwell_times import DwellTimes, LearnedDwells
from deconflict.contention.queues.queue_advice import QueueAdvice
from deconflict.contention.queues.queue_entries import LOOK_S, QueueEntries
from deconflict.contention.queues.queue_forecast import QueueForecast, forecast_queues
from deconflict.contention.queues.zone_flow import ZoneFlows
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.blockage_advice import blockage_advice
from deconflict.contention.waiting.blockages import Blockage, blockages
from deconflict.contention.waiting.deadlocks import RingLink, rings
from deconflict.contention.waiting.detours import Refuge
from deconflict.contention.waiting.free_crossings import (
    Crossing,
    crossing_advice,
    crossing_of,
    crossing_wants,
    mutual_waits,
)
from deconflict.contention.waiting.wait_graph import (
    Hindrance,
    Leg,
    NearbyBoxes,
    aisle_wants,
    hindrances,
    legs,
    place_wants,
    way_wants,
)
from deconflict.runtime.learned_state import Learner
from deconflict.settings.site import Site
from deconflict.sweep.geometry.heights import largest_group_at_one_height
from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch
from ingest.measures.measures import Measures

TO_VEHICLES = frozenset(("wait", "slow_down", "back_out", "take_another_route"))
"""Actions that are asked of vehicles only."""


def of_vehicles(found: Iterable[Finding], robots: Mapping[str, RobotView]) -> Iterator[Finding]:
    """The findings that are not of people on foot alone, without what they ask of people on foot.

    Who goes first is said as long as somebody yields.
    """
    for finding in found:
        on_foot = [uuid in robots and robots[uuid].on_foot for uuid in finding.robots]
        if all(on_foot):
            continue
        yield _asking_vehicles(finding, robots) if any(on_foot) else finding


def _asking_vehicles(finding: Finding, robots: Mapping[str, RobotView]) -> Finding:
    advice = finding.recommendation
    if advice is None:
        return finding
    kept = [action for action in advice.actions if not (action.action in TO_VEHICLES and robots[action.robot].on_foot)]
    if len(kept) == len(advice.actions):
        return finding
    is_yielded = any(action.action != "go_first" for action in kept)
    return finding._replace(recommendation=advice.model_copy(update={"actions": tuple(kept if is_yielded else ())}))


NEEDS_S = 10.0
"""Time between two forecasts of who will need a charger."""
NO_QUEUE = QueueForecast([], 0, [], [], 0.0, 0)


class Contention:
    """Queues at shared places, deadlocks, and robots in the way of others."""

    def __init__(
        self,
        site: Site,
        measures: Measures,
        restored: Iterable[FindingAdvisory],
        make_advice: Callable[[PlaceGeometry], QueueAdvice],
        crowds: Mapping[str, int],
        slots: RobotSlots,
    ) -> None:
        """`restored` are the advisories that were open before a restart. `crowds` has the robots that are in a crowd,
        and may change; `slots` are those of the robots on the floor."""
        self.geometry = PlaceGeometry(site.resources, site.zones)
        self.robots = RobotTable(self.geometry, slots)
        self._settings, self._reading = site.contention, site.reading
        self._measures, self._crowds = measures, crowds
        self._lifecycle = FindingLifecycle(site.contention.clear_after_s, restored)
        self._advice = make_advice(self.geometry)
        self._dwells = {resource.id: DwellTimes(resource) for resource in self.geometry.resources.values()}
        self._flows = ZoneFlows({zone.id: zone.capacity for zone in self.geometry.zones.values()})
        self._entries = QueueEntries(self.geometry, self.robots, self._dwells, self._flows)
        self._ordinary_queues = OrdinaryQueues(site.contention.fleet_wait_s, measures)
        self._ordinary_blockages = OrdinaryBlockages(site.contention, site.reading.quiet_after_s, measures)
        self._usual_durations = {
            **self._ordinary_blockages.usual_durations,
            "queues_of_fleet": self._ordinary_queues.usual_durations,
        }
        self._looked_s = self._needs_s = -inf
        """When the last look was, and the last forecast of who will need a charger."""
        self.queues: dict[str, QueueForecast] = {}
        """The queue of each place that a robot has or wants, by the last look."""
        self._rings: list[tuple[RingLink, ...]] = []
        self.crossings: Sequence[Crossing] = ()
        """Where robots stood for each other before a free crossing when it was last looked for."""
        self.needs: list[ChargingNeed] = []
        """Robots that may need a charger and have not announced that they come to one, by the last forecast."""
        self._shortages: list[ChargerShortage] = []
        measures.call_before_reading(self._measure)

    def open(self) -> list[FindingAdvisory]:
        """The newest revision of every open advisory."""
        return self._lifecycle.open()

    def adopt(self, revision: FindingAdvisory) -> None:
        """Continue from a revision that another process made."""
        self._lifecycle.adopt(revision)

    @property
    def learners(self) -> dict[str, Learner]:
        """What is worth keeping over a restart: errors of arrival times, dwells, batteries and usual waits."""
        arrivals = self.robots.arrivals
        return {
            "arrivals": arrivals,
            "lateness": arrivals.lateness,
            "overdue": arrivals.overdue,
            "stays": LearnedDwells(self._dwells),
            "batteries": self.robots.batteries,
            **self._usual_durations,
        }

    def receive(self, batch: Batch) -> None:
        """Update the robots that changed."""
        for resource, dwell_s in self.robots.update(batch):
            self._dwells[resource].add(dwell_s)
        self.robots.forget(batch.gone)
        self._lifecycle.end_without(batch.off_floor)

    def step(self, now_s: float) -> list[FindingAdvisory]:
        """The revisions of this look; none between looks."""
        if now_s - self._looked_s < LOOK_S:
            return []
        dt_s = min(now_s - self._looked_s, 10 * LOOK_S)
        self._looked_s = now_s
        passing = self.robots.passing()
        self._flows.update(passing, now_s, dt_s)
        passing, bound = self._believed(passing), self._believed(self.robots.bound())
        nearby = NearbyBoxes.of(self.robots, self._crowds)
        journeys = legs([*self._believed(self.robots.placed()), *bound], self.robots, nearby, now_s)
        entries = self._entries.collect(passing, bound, journeys, now_s)
        self.queues = forecast_queues(entries, self.geometry, now_s)
        in_way = hindrances(self.robots, nearby, now_s)
        self._forecast_charging(now_s)
        found = [*self._long_waits(now_s), *self._charger_shortages(now_s), *self._double_occupancies(now_s)]
        found += self._deadlocks_and_blockages(passing, journeys, in_way, now_s)
        self._measures.level("deconflict_deadlocks_ahead", {(): len(self._rings)})
        return self._lifecycle.revise(now_s, of_vehicles(found, self.robots), self._named)

    def _believed(self, robots: Iterable[RobotView]) -> list[RobotView]:
        """Those of `robots` that are in no crowd."""
        return [robot for robot in robots if robot.uuid not in self._crowds]

    def _named(self, uuid: str) -> NamedRobot:
        robot = self.robots[uuid]
        return NamedRobot(robot.name, robot.vendor, robot.participant)

    def _long_waits(self, now_s: float) -> Iterable[Finding]:
        """Places where a robot will wait long, with the slots that cost least."""
        self._advice.begin_look(now_s)
        published = [place for place in self.queues if self._lifecycle.is_open(f"contention {place}")]
        self._ordinary_queues.add_look(self.queues, published, self.robots, now_s)
        for place, queue in self.queues.items():
            if queue.longest_wait_s < self._settings.least_wait_s:
                continue
            if place in published or not self._ordinary_queues.is_ordinary(place, queue, self.robots, now_s):
                advice = self._advice.slots(place, self.queues, self.robots, now_s)
                yield findings.contention(self.geometry, place, queue, advice, self.robots, now_s)

    def _forecast_charging(self, now_s: float) -> None:
        """Forecast every few seconds who will need a charger, and which chargers will then be full."""
        if self.geometry.chargers and now_s - self._needs_s >= NEEDS_S:
            self._needs_s = now_s
            self.needs = charging_needs(
                self.robots, self.robots.batteries, self.geometry, self._reading.silent_after_s, now_s
            )
            usual_s = {charger: self._dwells[charger].service_s for charger in self.geometry.chargers}
            standing = [shortage.chargers[0] for shortage in self._shortages]
            self._shortages = charger_shortages(self.needs, self.queues, self.geometry, now_s, usual_s, standing)

    def _charger_shortages(self, now_s: float) -> Iterable[Finding]:
        """Chargers that will be full for robots that have not announced that they come.

        None where robots that have announced it already wait long: that is another finding.
        """
        long_s = self._settings.least_wait_s
        for shortage in self._shortages:
            queues = [self.queues[charger] for charger in shortage.chargers if charger in self.queues]
            some_wait = any(queue.longest_wait_s >= long_s for queue in queues)
            robots = {*shortage.announced, *(need.robot for need in shortage.needs)}
            if self.robots.keys() >= robots and not some_wait and shortage.wait_s >= long_s:
                yield findings.shortage(self.geometry, shortage, self.robots, now_s)

    def _double_occupancies(self, now_s: float) -> Iterable[Finding]:
        """Places with more robots inside, also by their newest reports, than their capacity."""
        for place, queue in self.queues.items():
            if queue.inside > self.geometry.capacity(place):
                inside = [entry for entry in queue.entries[: queue.inside] if self.robots[entry.robot].was_in(place)]
                group = largest_group_at_one_height(inside)
                if len(group) > self.geometry.capacity(place):
                    yield findings.double_occupancy(self.geometry, place, queue, group, now_s)

    def _deadlocks_and_blockages(
        self, passing: list[RobotView], journeys: list[Leg], in_way: list[Hindrance], now_s: float
    ) -> Iterable[Finding]:
        """Rings of waiting robots, and robots that block others. People walk around what is in their way."""
        aisles = [zone.id for zone in self.geometry.zones.values() if zone.kind == "aisle"]
        capacity = {resource.id: resource.capacity for resource in self.geometry.resources.values()}
        wants = place_wants(journeys, capacity)
        for_good = [each for each in in_way if not self.robots[each.waiter].on_foot]
        crossings = mutual_waits(self.crossings, self.robots)
        wants += [*aisle_wants(passing, aisles), *crossing_wants(crossings.values())]
        self._rings = rings([*wants, *way_wants(for_good, self.robots, aisles, now_s)])
        found = blockages(in_way, self.robots)
        found = self._ordinary_blockages.publishable(
            found, self.robots, lambda blocker: self._lifecycle.is_open(f"blockage {blocker}"), now_s
        )
        refuges = self._refuges() if self._rings or found else []
        for ring in self._rings:
            if crossing := crossing_of(ring, crossings):
                yield findings.mutual_wait(ring, crossing, crossing_advice(crossing, self.robots), self.robots, now_s)
                continue
            advice = self._advice.way_out(ring, self.robots, refuges, now_s)
            yield findings.deadlock(self.geometry, ring, advice, self.robots, now_s)
        for blocked in found:
            yield self._blockage(blocked, refuges, now_s)

    def _blockage(self, blocked: Blockage, refuges: Sequence[Refuge], now_s: float) -> Finding:
        """A blockage that is published, with what would help."""
        quiet_after_s = self._reading.quiet_after_s
        left_s = self._ordinary_blockages.left_s(blocked, self.robots, now_s)
        floor = self.robots, self.geometry, refuges
        advice = blockage_advice(blocked, *floor, left_s, quiet_after_s, now_s)
        return findings.blockage(blocked, advice, self.robots, quiet_after_s, now_s)

    def _refuges(self) -> list[Refuge]:
        """Resources with room left, where a robot is in nobody's way."""
        free = [
            resource.id
            for resource in self.geometry.resources.values()
            if resource.kind != "lift" and len(self.queues.get(resource.id, NO_QUEUE).entries) < resource.capacity
        ]
        return [Refuge(place, *self.geometry.middle(place)) for place in free]

    def _measure(self) -> None:
        if self._looked_s == -inf:
            return
        flows, arrivals = self._flows.by_zone, self.robots.arrivals
        queues = {place: self.queues.get(place, NO_QUEUE) for place in (*self._dwells, *flows)}
        levels: dict[str, Mapping[str, float]] = {
            "deconflict_resource_demand": {place: len(queue.entries) for place, queue in queues.items()},
            "deconflict_resource_occupancy": {place: queue.inside for place, queue in queues.items()},
            "deconflict_resource_wait_seconds": {place: queue.longest_wait_s for place, queue in queues.items()},
            "deconflict_resource_expected_demand": self._expected_demand(),
            "deconflict_usual_places": {name: len(usual) for name, usual in self._usual_durations.items()},
            "deconflict_usual_places_dropped_total": {
                name: usual.dropped for name, usual in self._usual_durations.items()
            },
            "deconflict_zone_flow_per_second": {zone: flow.flow_per_s for zone, flow in flows.items()},
            "deconflict_zone_saturation_ratio": {zone: flow.saturation for zone, flow in flows.items()},
            "deconflict_arrival_time_ratio": {vendor: arrivals.quantiles(vendor)[1] for vendor in arrivals.counts()},
        }
        arrivals.lateness.measure(self._measures)
        for name, series in levels.items():
            self._measures.level(name, {(label,): value for label, value in series.items()})

    def _expected_demand(self) -> dict[str, float]:
        """By charger, how many robots need it without having announced it; a robot with a choice counts in parts."""
        demand = dict.fromkeys(self.geometry.chargers, 0.0)
        for need in self.needs:
            for charger in need.chargers:
                demand[charger] += float(need.likely[-1]) / len(need.chargers)
        return demand
