"""The engine: batches in, advisory revisions out.

Pure: `receive` takes a batch, `step` the time of a tick. The live service, tests and replay drive the same engine,
and the same calls give the same advisories.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from heapq import heappop, heappush
from math import floor, inf

import numpy as np

from deconflict.advice.async_answers import Aside, Submit, at_once
from deconflict.advice.burden import Account
from deconflict.advice.delay_windows import Mover, Near
from deconflict.advice.hold_desk import MOST_NEAR, NEAR_M, Desk
from deconflict.advice.priorities import Priorities
from deconflict.advisories.advisory_counts import NEAR_MISSES, by_severity, tally, tell_open
from deconflict.advisories.conflict_lifecycle import LEFT, Lives
from deconflict.advisories.conflict_wording import Party, Predictions, Scene
from deconflict.advisories.watched_pairs import held_probability
from deconflict.advisory import AnyAdvisory, ClaimAdvisory, ConflictAdvisory
from deconflict.contention.contention import Contention
from deconflict.contention.queues.charger_forecast import Need
from deconflict.contention.queues.queue_advice import Advising
from deconflict.contention.queues.queue_forecast import Turns
from deconflict.engine.claim_lifecycle import Claims
from deconflict.engine.load_shedding import Effort
from deconflict.engine.map_drift import Rests
from deconflict.engine.near_miss_trigger import Trigger
from deconflict.engine.place_names import Landmarks, Spot
from deconflict.foresight.presence import presence_batches
from deconflict.foresight.presence.live_robots import LiveRobot, LiveRobots
from deconflict.foresight.presence.presence import Presence
from deconflict.foresight.probability.advice_followers import waits_until_s
from deconflict.foresight.probability.estimator import ProbabilityEstimator, SweptConflicts
from deconflict.runtime.learned_state import Part
from deconflict.settings.site import Site
from deconflict.sweep.geometry.encounter import Encounter, encounter, separation_m
from deconflict.sweep.incremental import ACCURACY_M, PairConflicts, Sweeper
from ingest.batch import Basis, Batch, Floats, Forecasts, Pair
from ingest.measures import clock_changes
from ingest.measures.measures import Measures

GROWTH_STEP_M = 0.1
"""The uncertainty of a quiet robot grows in steps, so that it is swept again only when it matters."""
COARSE_M = 0.25
"""Of the smallest separation, where there is no time for more."""
_IN_WORDS = {basis: basis.name.lower() for basis in Basis}
SILENT = "is silent and has probably left"
FAR_LOOK_S = 10.0
"""How often queues are looked at where there is no time for more."""


class Engine:
    """Live state, the sweep, and the life of advisories. Keeps its own `measures`."""

    def __init__(
        self,
        site: Site,
        restored: Iterable[AnyAdvisory] = (),
        ordinals: dict[Pair, int] | None = None,
        submit: Submit = at_once,
        burdens_s: Mapping[str, float] | None = None,
        learned: Mapping[str, Part] | None = None,
        *,
        conflicts_only: bool = False,
    ) -> None:
        """`learned` is what an earlier engine's `learned()` told. Raises `UnreadableError` where it can't be that.

        With `conflicts_only` nothing is judged that is not of one place: queues, deadlocks, blockages, claims.
        """
        self.site, self._conflicts_only = site, conflicts_only
        self.measures = Measures()
        self.live = LiveRobots()
        self.presence = Presence(self.live, self.measures)
        self._landmarks = Landmarks(site.datums, (*site.resources, *site.zones))
        self._sweeper = Sweeper(clearance_m=site.conflict.clearance_m, horizon_s=site.conflict.horizon_s)
        conflict = site.conflict
        self.foresight = ProbabilityEstimator(
            conflict.clearance_m, conflict.clear_margin_m, conflict.horizon_s, self.measures
        )
        self._lives = Lives(site.conflict, site.reading.silent_after_s, dict(ordinals or {}))
        there = self.live.robots.__contains__
        meets = self._meet, self._sweeper.encounters
        of_robots = there, self._absence, self._party, self._stands
        self._scene = Scene(*of_robots, *meets, self._separation_m, self._datum, self._places)
        restored = tuple(restored)
        self._lives.restore(one for one in restored if isinstance(one, ConflictAdvisory))
        self._submit, self._aside = submit, Aside(submit)
        self._account, self._priorities = Account(burdens_s), Priorities(site.vendors)
        advising = partial(
            Advising,
            account=self._account,
            effort=site.advice.effort,
            submit=self._aside.submit,
            priority=self._priority,
            measures=self.measures,
        )
        queues = [one for one in restored if not isinstance(one, ConflictAdvisory | ClaimAdvisory)]
        self._contention = Contention(site.resources, site.zones, site.contention, self.measures, queues, advising)
        self._claims = Claims(self.live, [one for one in restored if isinstance(one, ClaimAdvisory)])
        self._desk = Desk(site, self._account, self.measures, self._aside.submit)
        self._rests = Rests.at(site.resources)
        if learned:
            self._resume(learned)
        self._trigger = Trigger(conflict.clearance_m, conflict.clear_margin_m)
        self.near_misses: list[Pair] = []
        """Pairs of which one moves that came within the clearance by the last step."""
        self._conflicts = 0
        """Pairs in predicted conflict at the last step."""
        self.measures.ask(self._tell_levels)
        self._contended_s = self._now_s = -inf
        self._told: set[str] = set()
        """Robots with a new forecast since the last step."""
        self._quiet: list[tuple[float, str]] = []
        """A heap of when a robot's silence is next looked at, and its UUID; one entry a robot."""

    def renewed(self, site: Site) -> "Engine":
        """An engine for a changed site that goes on with what is open and learned, yet to hear of the floor."""
        return Engine(
            site,
            self.open(),
            self._lives.ordinals,
            self._submit,
            self._account.burdens_s,
            self.learned(),
            conflicts_only=self._conflicts_only,
        )

    def open(self) -> list[AnyAdvisory]:
        """The newest revision of every open advisory."""
        return [*self._lives.told.values(), *self._shared_open()]

    def _shared_open(self) -> list[AnyAdvisory]:
        return [*self._contention.open(), *self._claims.open()]

    def learned(self) -> dict[str, Part]:
        """What is worth keeping over a restart, as it is now: later calls do not change it."""
        others = self._contention.learned() | self.presence.learned()
        return self.foresight.learned() | others | {"rests": self._rests.learned()}

    def _resume(self, learned: Mapping[str, Part]) -> None:
        self.foresight.resume(learned)
        self._contention.resume(learned)
        self._rests.resume(learned.get("rests", {}))
        self.presence.resume(learned)

    def receive(self, batch: Batch) -> None:
        """Take in the robots that changed; a batch may be the whole floor."""
        batch = self.presence.receive(batch)
        self.foresight.settle_absent(self.presence.passed)
        batch = self._take_in(batch)
        if not self._conflicts_only:
            self._contention.receive(batch)
            self._claims.receive(batch.claims)

    def _take_in(self, batch: Batch) -> Batch:
        """Take in robots where conflicts are looked for. The batch as it is believed."""
        batch = self.foresight.receive(batch)
        for uuid in self.live.update(batch):
            heappush(self._quiet, (self.live.robots[uuid].event_s + self.site.reading.quiet_after_s, uuid))
        self._told.update(batch.robots)
        self._sweep(batch.robots, batch.forecasts, 2 * batch.doubt_m)
        self._rests.see(batch)
        self.live.remove(batch.gone)
        self._told.difference_update(batch.gone)
        self._sweeper.discard(batch.gone)
        return batch

    def pending(self) -> int:
        """How many answers, the newest of those asked for, are still worked out."""
        return self._aside.pending()

    def step(
        self, now_s: float, effort: Effort = Effort.FULL, pending: int | None = None, heard: bool = True
    ) -> list[AnyAdvisory]:
        """Sweep what changed, and say what that changes for people, with no more work than `effort` allows.

        `pending` answers are not given yet: what `pending()` told before the step, or a recording of that; what it
        tells now if absent. `heard` is whether robots may act on what is advised: those of a log that another service
        recorded could not.
        """
        self._aside.settle(self.pending() if pending is None else pending)
        self._now_s = now_s
        silent = self._fade(now_s)
        if grown := self._grown(now_s):
            self._sweep(*self._known(sorted(grown)))
        told, self._told = self._told, set()
        reach_s = self.site.conflict.warning_s if effort >= Effort.NEAR else inf
        accuracy_m = COARSE_M if effort >= Effort.COARSE else ACCURACY_M
        conflicts = self._sweeper.find_conflicts(now_s, reach_s, accuracy_m)
        self.near_misses = [pair for pair in self._trigger.step(conflicts) if self._moves(pair)]
        self.measures.count(NEAR_MISSES, by=len(self.near_misses))
        predictions = self._foreseen(now_s, conflicts).until(now_s + reach_s)
        revisions: list[AnyAdvisory] = [*self._lives.step(now_s, predictions, told, self._scene, now_s + reach_s)]
        revisions += self._lives.silence(silent, now_s, self._scene)
        revisions += self._advise(now_s)
        if not self._conflicts_only:
            revisions += self._shared(now_s, effort)
        self._account.settle(revisions)
        if heard:
            self.foresight.note_advice(now_s, waits_until_s(revisions))
        self._measure(conflicts, revisions)
        return revisions

    def _fade(self, now_s: float) -> set[str]:
        """Have silent robots be as likely there as they are now; those that have fallen silent since the last step."""
        changes = self.presence.advance(now_s)
        for uuid, there in changes.there.items():
            self.foresight.set_presence(uuid, there)
        self.foresight.mark_silent(changes.silent)
        if changes.stopped:
            self._take_in(presence_batches.stopped_batch(self.live, changes.stopped, now_s))
        for batch in () if self._conflicts_only else presence_batches.contention_batches(self.live, changes, now_s):
            self._contention.receive(batch)
        return changes.silent

    def _shared(self, now_s: float, effort: Effort) -> list[AnyAdvisory]:
        """The revisions on what is not of one place."""
        revisions: list[AnyAdvisory] = []
        if effort < Effort.NEAR or now_s - self._contended_s >= FAR_LOOK_S:
            revisions += self._contention.step(now_s)
            self._contended_s = now_s
        return [*revisions, *self._claims.step(now_s)]

    def conflicts(self) -> list[ConflictAdvisory]:
        """The newest revision of each open advisory of a conflict."""
        return list(self._lives.told.values())

    def adopt(self, told: ConflictAdvisory) -> None:
        """Go on from a revision that another engine decided."""
        self._lives.adopt(told)

    def _advise(self, now_s: float) -> list[AnyAdvisory]:
        """The revisions that give conflicts the advice that is due."""
        due = self._desk.step(now_s, self._lives.told, self._lives.changed(), self._around)
        return [told for pair, advice in due if (told := self._lives.advise(pair, advice, now_s))]

    def _around(self, group: set[str]) -> Near:
        """The robots of a group that are on the floor, and those near to them, as they are now."""
        uuids = self.live.group_with_nearest(group & self.live.robots.keys(), NEAR_M, MOST_NEAR)
        told = [(one.batch, one.row) for one in map(self.live.robots.__getitem__, uuids)]
        vendors = [batch.vendors[row] for batch, row in told]
        return Near(uuids, vendors, *self._sweeper.copied(uuids), lambda row: self._mover(*told[row]))

    def _mover(self, batch: Batch, row: int) -> Mover:
        vendor, holdable = batch.vendors[row], int(batch.basis[row]) != Basis.STATIONARY
        return Mover(batch.names[row], vendor, holdable, self._priorities.of(vendor, batch.models[row]))

    def _priority(self, uuid: str) -> float:
        one = self.live.robots[uuid]
        return self._priorities.of(one.vendor, one.model)

    def probabilities(self) -> list[tuple[Pair, float]]:
        """The standing probability of every watched pair to come within the clearance in the horizon, after `step`."""
        return self.foresight.probabilities()

    def turns(self) -> Mapping[str, Turns]:
        """Who has each place that robots share, or will, and from when to when, by the last look."""
        return self._contention.turns

    def needs(self) -> Sequence[Need]:
        """Robots that may need a charger and have not said that they come to one."""
        return self._contention.needs

    def _foreseen(self, now_s: float, conflicts: PairConflicts) -> Predictions:
        """The pairs that the exact sweep found, and those that may well turn out otherwise."""
        likely = held_probability(self.site.conflict)
        swept = SweptConflicts(
            conflicts.pairs, conflicts.before, conflicts.separation_m, conflicts.separation_at_s, conflicts.contact_s
        )
        foreseen = self.foresight.estimate(now_s, swept, likely)
        contact_s, separation_m, start_m, fresh = foreseen.near_s, foreseen.near_m, foreseen.now_m, foreseen.fresh
        n = len(conflicts.pairs)
        contact_s[:n], separation_m[:n] = conflicts.contact_s, conflicts.separation_m
        start_m[:n], fresh[:n] = conflicts.start_separation_m, conflicts.fresh
        there = self.presence.both_there(foreseen.pairs)
        columns = (foreseen.probability, *foreseen[6:], there)
        return Predictions(foreseen.pairs, contact_s, separation_m, start_m, fresh, *columns)

    def _sweep(self, keys: Sequence[str], told: Forecasts, widened_m: Floats) -> None:
        for _, reason in self._sweeper.update(keys, _widened(told, widened_m), widened_m):
            self.measures.count("deconflict_invalid_forecasts_total", reason)

    def _swept(self, uuids: Iterable[str]) -> tuple[list[str], Forecasts]:
        """The robots of `uuids` that are on the floor, and their forecasts with envelopes as they are swept."""
        keys, told, widened_m = self._known(uuids)
        return keys, _widened(told, widened_m)

    def _known(self, uuids: Iterable[str]) -> tuple[list[str], Forecasts, Floats]:
        """The robots of `uuids` that are on the floor, their forecasts, and how much wider each is swept."""
        keys, told = self.live.forecasts(uuids)
        return keys, told, np.array([self.live.robots[uuid].widened_m for uuid in keys])

    def _grown(self, now_s: float) -> set[str]:
        """Robots not heard from for so long that their uncertainty grows a step."""
        grown = set()
        while self._quiet and self._quiet[0][0] <= now_s:
            _, uuid = heappop(self._quiet)
            robot = self.live.robots.get(uuid)
            if robot is None:
                continue
            next_s = robot.event_s + self.site.reading.quiet_after_s
            if next_s <= now_s:
                next_s = self._grow(robot, now_s - next_s, next_s)
                grown.add(uuid)
            heappush(self._quiet, (next_s, uuid))
        return grown

    def _grow(self, robot: LiveRobot, quiet_for_s: float, since_s: float) -> float:
        """Grow a quiet robot's uncertainty to what it is now; when to look again."""
        rate_mps, limit_m = self.site.conflict.silent_growth_mps, self.site.conflict.silent_growth_limit_m
        steps = floor(quiet_for_s * rate_mps / GROWTH_STEP_M) + 1
        robot.growth_m = min(steps * GROWTH_STEP_M, limit_m)
        if rate_mps == 0 or robot.growth_m >= limit_m:
            return since_s + quiet_for_s + self.site.reading.forget_after_s
        return since_s + steps * GROWTH_STEP_M / rate_mps

    def _moves(self, pair: Pair) -> bool:
        return not all(map(self._stands, pair))

    def _stands(self, uuid: str) -> bool:
        robot = self.live.robots.get(uuid)
        return robot is not None and (robot.basis is Basis.STATIONARY or self.foresight.is_standing(uuid))

    def _party(self, uuid: str) -> Party:
        robot = self.live.robots[uuid]
        basis = robot.basis
        silent_s = self.presence.silent_s(uuid, self._now_s)
        remarks = {"distrusted": self.foresight.is_distrusted(uuid), "silent": silent_s is not None}
        words = _IN_WORDS[basis] + "".join(f" ({remark})" for remark, holds in remarks.items() if holds)
        return Party(robot.name, robot.vendor, words, basis is Basis.STATIONARY, silent_s)

    def _absence(self, uuid: str) -> str | None:
        if uuid in self.live.robots:
            return SILENT if self.presence.has_probably_left(uuid) else None
        off = self.presence.removal_of(uuid)
        return f"is not there: {off.by} has driven through its place" if off else LEFT

    def _meet(self, pair: Pair, contact_s: float) -> Encounter:
        a, b = (self.live.robots[uuid] for uuid in pair)
        return encounter((a.batch_forecasts, a.row), (b.batch_forecasts, b.row), contact_s)

    def _separation_m(self, pair: Pair, now_s: float) -> float | None:
        a, b = (self.live.robots[uuid] for uuid in pair)
        return separation_m((a.batch_forecasts, a.row), (b.batch_forecasts, b.row), now_s)

    def _datum(self, met: Encounter) -> str:
        return self.live.floors[met.floor]

    def _places(self, met: Sequence[Encounter]) -> list[str]:
        return self._landmarks.places([Spot(self._datum(one), one.x_m, one.y_m) for one in met])

    def _measure(self, conflicts: PairConflicts, revisions: list[AnyAdvisory]) -> None:
        tally(self.measures, revisions)
        self._conflicts = len(conflicts.pairs)
        self.measures.count("deconflict_sweep_segment_pairs_total", by=conflicts.segment_pairs)
        self.measures.count("deconflict_sweep_fcl_calls_total", by=conflicts.fcl_calls)

    def _tell_levels(self) -> None:
        tell_open(self.measures, by_severity(self.open()))
        self.measures.level("deconflict_datum_drift_metres", self._rests.drift_m())
        clock_changes.tell(
            self.measures, {"forecast": self.foresight.degradation.changed(), "datum": self._rests.changed()}
        )
        self.measures.level("deconflict_conflicts", {(): self._conflicts})


def _widened(forecasts: Forecasts, by_m: Floats) -> Forecasts:
    f = forecasts
    sizes_m = (f.length_m + by_m, f.width_m + by_m, f.bottom_m, f.top_m)
    return Forecasts(f.start, f.t_s, f.x_m, f.y_m, f.yaw_rad, f.floor, *sizes_m)
