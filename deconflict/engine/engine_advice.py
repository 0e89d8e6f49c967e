"""All advice of one engine: holds for conflicts, slots for queues, and what both have in common."""

from collections.abc import Callable, Mapping

from deconflict.advice.deferred_answers import AsyncAnswers, Submit
from deconflict.advice.holds.hold_windows import NearbyRobots, PlannedRobot
from deconflict.advice.priorities import Priorities
from deconflict.advice.requests.hold_requests import MOST_NEAR, NEAR_M, HoldRequests
from deconflict.advice.vendor_burden import Burden
from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.contention.queues.queue_advice import queue_advice
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.settings.site import Site
from deconflict.sweep.incremental import Sweeper
from deconflict_client.advisory import ConflictAdvisory
from ingest.batch import Basis, Batch
from ingest.measures.measures import Measures


class EngineAdvice:
    """Asks for advice, and gives the answers that are due."""

    def __init__(
        self,
        site: Site,
        live: LiveRobots,
        sweeper: Sweeper,
        measures: Measures,
        submit: Submit,
        burdens_s: Mapping[str, float] | None,
        crowds: Mapping[str, int],
        last_waited_s: Callable[[str], float],
    ) -> None:
        """`submit` has an answer worked out; `burdens_s` are the seconds that each vendor has waited by now. `crowds`
        has the robots that are in a crowd, and may change. `last_waited_s` is when a robot last waited as advised."""
        self._live, self._sweeper, self._crowds, self._last_waited_s = live, sweeper, crowds, last_waited_s
        self._crowded: frozenset[str] = frozenset()
        """The robots that were in a crowd in the last pass."""
        self._priorities = Priorities(site.vendors)
        self.submit = submit
        self.answers = AsyncAnswers(submit)
        """Those to all questions for advice."""
        self.burden = Burden(burdens_s)
        self._holds = HoldRequests(site, self.burden, measures, self.answers.submit)
        self.queue_advice = queue_advice(site, live, self.burden, self.answers.submit, measures)
        """Makes the advice on queues; `Contention` calls it with its geometry."""

    def add_holds(self, now_s: float, conflicts: ConflictLifecycle) -> list[ConflictAdvisory]:
        """The revisions that give conflicts the holds that are due; none of robots in a crowd, whose places are
        doubted."""
        changed, crowded = conflicts.take_changed(), frozenset(self._crowds)
        if crowded != self._crowded:
            self._crowded, changed = crowded, changed | conflicts.advisories.keys()
        placed = {pair: conflicts.advisories.get(pair) if crowded.isdisjoint(pair) else None for pair in changed}
        due = self._holds.step(now_s, placed, self._nearby)
        revisions = (conflicts.add_advice(pair, advice, now_s) for pair, advice in due)
        return [revision for revision in revisions if revision]

    def _nearby(self, group: set[str]) -> NearbyRobots:
        """The robots of a group that are on the floor, and those near to them, as they are now."""
        uuids = self._live.group_with_nearest(group & self._live.robots.keys(), NEAR_M, MOST_NEAR, self._crowds)
        rows = [(robot.batch, robot.row) for robot in map(self._live.robots.__getitem__, uuids)]
        vendors = [batch.vendors[row] for batch, row in rows]
        waited_s = [self._last_waited_s(uuid) for uuid in uuids]
        near = uuids, vendors, *self._sweeper.copied(uuids)
        return NearbyRobots(*near, lambda i: self._planned(*rows[i], waited_s[i]))

    def _planned(self, batch: Batch, row: int, waited_s: float) -> PlannedRobot:
        vendor, stands = batch.vendors[row], int(batch.basis[row]) == Basis.STATIONARY
        on_foot = batch.participants[row] == "person"
        priority = self._priorities.of(vendor, batch.models[row], on_foot=on_foot)
        return PlannedRobot(batch.names[row], vendor, not (stands or on_foot), priority, waited_s, on_foot)
