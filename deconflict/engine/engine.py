"""The engine: batches in, advisory revisions out.

Pure: `receive` takes a batch, `step` the time of a pass. The live service, tests and replay drive the same engine, and
the same calls give the same advisories.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from deconflict.advice.deferred_answers import Submit, answer_at_once
from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.advisories.encounter_numbers import EncounterNumbers
from deconflict.advisories.live_scene import LiveScene
from deconflict.advisories.loss_warnings import LossWarnings
from deconflict.advisories.revision_rules import held_probability
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.contention.crowds.crowds import Crowds
from deconflict.contention.queues.charger_forecast import ChargingNeed
from deconflict.contention.queues.queue_forecast import QueueForecast
from deconflict.engine.engine_advice import EngineAdvice
from deconflict.engine.engine_metrics import EngineMetrics, count_losses
from deconflict.engine.learned.first_learned_format import upgraded
from deconflict.engine.learned.map_drift import MapDrift
from deconflict.engine.learned.under_way import take_over, under_way
from deconflict.engine.load_shedding import Effort
from deconflict.engine.robot_sweep import PairClaims, RobotSweep
from deconflict.engine.shared_advisories import SharedAdvisories
from deconflict.foresight.conflict_predictions import Predictions
from deconflict.foresight.learned_estimates import estimator_learners
from deconflict.foresight.losses.loss_places import LossPlaces, PlacedLoss
from deconflict.foresight.losses.refusal import AdviceRefusal
from deconflict.foresight.near_misses.near_events import NearMissTrigger
from deconflict.foresight.presence import presence_batches
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.presence import HEARD_GROUND, MOST_SHOWN, Presence
from deconflict.foresight.probability.advice_followers import waits_until_s
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.foresight.probability.pair_candidates import SweptConflicts
from deconflict.runtime.learned_state import Learner, Part, learned_of, resume_all
from deconflict.settings.site import Site
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.incremental import ACCURACY_M
from deconflict_client.advisory import AnyAdvisory, ClearedCode, ConflictAdvisory
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import advisories_of
from deconflict_client.verbs import Followed
from ingest.batch import Batch, Pair
from ingest.frames.floor_numbers import FloorNumbers
from ingest.measures.measures import Measures

COARSE_M = 0.25
"""Accuracy of the smallest separation when the engine can't keep up."""


class Engine:
    """Live robots, their sweep and forecasts of conflicts, and the open advisories. Keeps its own `measures`."""

    near_misses: list[Pair]
    """Pairs that came within the clearance in the last pass while one of them moved."""
    losses: list[PlacedLoss]
    """Losses that ended before the last pass. With `conflicts_only` without what was published before: others publish
    too."""

    refusals: list[AdviceRefusal]
    """Refusals of advice that were over at the last call of `advise`."""

    followed: list[Followed]
    """What robots did as they were asked, if the last call of `advise` was a look."""

    set_aside: dict[str, str]
    """The parts of the learned state with which this engine does not go on, each with the reason."""

    def __init__(
        self,
        site: Site,
        restored: Collection[AnyAdvisory | RobotAdvice] = (),
        ordinals: Mapping[Pair, int] | None = None,
        submit: Submit = answer_at_once,
        burdens_s: Mapping[str, float] | None = None,
        learned: Mapping[str, Part] | None = None,
        *,
        conflicts_only: bool = False,
    ) -> None:
        """`restored` are advisories and advice that were open before, `ordinals` as of `EncounterNumbers`.

        `submit` has advice worked out, `burdens_s` are the seconds that each vendor has waited so far, `learned` is
        what `learned()` of an earlier engine gave; parts that can't be used are set aside. With `conflicts_only` there
        are no advisories on queues, deadlocks, blockages and claims, and nothing is asked of robots.
        """
        self.site, self._conflicts_only, self.measures = site, conflicts_only, Measures()
        advisories, names, conflict = advisories_of(restored), PlaceNames.of(site), site.conflict
        named, self.live, self.floors = {each.name for each in site.vendors}, LiveRobots(), FloorNumbers(self.measures)
        self.presence = Presence(self.live, self.measures, site)
        self._crowds, self._trigger = Crowds(self.live), NearMissTrigger(conflict.clearance_m, conflict.apart_m)
        self._conflicts = ConflictLifecycle(conflict, site.reading.silent_after_s, EncounterNumbers(ordinals or {}))
        crowds, bounds = self._crowds.numbers, (conflict.clearance_m, conflict.apart_m, conflict.horizon_s)
        self.claims = PairClaims(self.live, self._conflicts, crowds)
        self.foresight = ProbabilityEstimator(*bounds, self.measures, crowds, self.claims, self.live.slots, named)
        self._sweep = RobotSweep(site, self.live, self.measures, crowds, self.claims)
        self._scene = LiveScene(self.live, self.presence, self.foresight, self._sweep.sweeper, names)
        self._conflicts.restore(advisory for advisory in advisories if isinstance(advisory, ConflictAdvisory))
        asking = self._sweep.sweeper, self.measures, submit, burdens_s, crowds, self.foresight.last_advised_wait_s
        self._advice = EngineAdvice(site, self.live, *asking)
        shared = self._crowds, self.measures, restored, self._advice.queue_advice, names.describe
        self._shared = SharedAdvisories(site, self.live, *shared, enabled=not conflicts_only)
        self._map_drift, self._loss_places = MapDrift.at(site.resources), LossPlaces.of(site)
        self.set_aside = self._resumed(learned) if learned else {}
        self._loss_warnings = LossWarnings(advisories, self.foresight.last_advised_wait_s, self.foresight.has_followed)
        self.near_misses, self.losses, self.refusals, self.followed = [], [], [], []
        self._updated: set[str] = set()
        """Robots with a new forecast since the last pass, and those that have left since."""
        self._metrics = EngineMetrics(self.measures, self.open, self.foresight, self._map_drift, self._partly_examined)

    def presence_document(self, now_s: float) -> dict[str, Any]:
        """The JSON document for people: silent robots, exits, robots whose motion contradicts their forecasts, and
        those that are compared with some others only."""
        partly_examined = self.claims.partly_examined()[:MOST_SHOWN]
        distrusted = self.foresight.distrusted()[:MOST_SHOWN]
        return self.presence.document(now_s) | {"distrusted": distrusted, "partly_examined": partly_examined}

    def renewed(self, site: Site) -> "Engine":
        """An engine for a changed site that continues what is open and learned; it has to receive all robots again."""
        return Engine(
            site,
            [*self.open(), *self._shared.asked.open()],
            self._conflicts.ordinals,
            self._advice.submit,
            self._advice.burden.burdens_s,
            self.learned(),
            conflicts_only=self._conflicts_only,
        )

    def open(self) -> list[AnyAdvisory]:
        """The newest revision of every open advisory."""
        return [*self._conflicts.advisories.values(), *self._shared.open()]

    def conflicts(self) -> list[ConflictAdvisory]:
        """The newest revision of every open conflict advisory."""
        return list(self._conflicts.advisories.values())

    def adopt(self, revision: ConflictAdvisory) -> None:
        """Continue from a revision that another engine made."""
        self._conflicts.adopt(revision)

    def resume(
        self,
        published: Iterable[AnyAdvisory],
        ordinals: Mapping[Pair, int],
        burdens_s: Mapping[str, float],
        learned: Mapping[str, Part] | None,
        underway: Mapping[str, Part],
    ) -> None:
        """Go on as another engine that made the same passes lately, with what it had published, learned and under way
        by now."""
        self.set_aside = self._resumed(learned) if learned else {}
        conflicts = (advisory for advisory in published if isinstance(advisory, ConflictAdvisory))
        self._conflicts.resume({advisory.robots: advisory for advisory in conflicts}, ordinals)
        self._advice.burden.burdens_s.update(burdens_s)
        self.set_aside |= take_over(underway, self.foresight, self._conflicts.pairs)

    def under_way(self) -> dict[str, Part]:
        """A copy of what is under way: with it and with `learned`, a black box begins."""
        return under_way(self.foresight, self._conflicts.pairs)

    def learned(self) -> dict[str, Part]:
        """A copy of what is worth keeping over a restart."""
        return learned_of(self._learners)

    @property
    def _learners(self) -> dict[str, Learner]:
        shared = self._shared.contention.learners | self._shared.asked.standoffs.learners
        return estimator_learners(self.foresight) | shared | self.presence.learners | {"rests": self._map_drift}

    def _resumed(self, learned: Mapping[str, Part]) -> dict[str, str]:
        """Go on with a learned state. Returns what `set_aside` has."""
        new = {*self._shared.asked.standoffs.learners, HEARD_GROUND}
        return resume_all(self._learners, upgraded(learned), new)

    def receive(self, batch: Batch) -> None:
        """Add the robots that changed, without those that are not `examined`. A batch may hold the whole floor."""
        batch = batch if batch.examined.all() else batch.take(np.flatnonzero(batch.examined), batch.gone)
        left, batch = batch.gone, self.presence.receive(self.floors.renumbered(batch))
        self.foresight.resolve_absent(self.presence.passed)
        for part in presence_batches.with_end_before(batch):
            self._shared.receive(self._add(part))
        self.live.slots.release(sorted(set(left).difference(batch.robots)))

    def _add(self, batch: Batch) -> Batch:
        """Add a batch to all that predicts conflicts; the batch with the forecasts that are believed."""
        batch = self.foresight.receive(batch)
        self._sweep.add(batch, self.live.update(batch))
        self._map_drift.observe(batch)
        self.live.remove(batch.gone)
        self._sweep.discard(batch.gone)
        self._updated.update(batch.robots, batch.gone)
        return batch

    def pending(self) -> int:
        """How many of the newest questions for advice have no answer yet."""
        return self._advice.answers.pending()

    def step(
        self,
        now_s: float,
        effort: Effort = Effort.FULL,
        pending: int | None = None,
        heard: bool = True,
        followed: Iterable[Followed] | None = None,
    ) -> list[AnyAdvisory]:
        """One pass: the revisions at `now_s`, with no more work than `effort` allows.

        `pending` newest questions count as not answered: `pending()` before the pass, or what a recording says of it;
        if None, `pending()` now; likewise `followed`. `heard` is whether robots may act on the advice: not those of a
        log that another service recorded.
        """
        self._advice.answers.set_pending(self.pending() if pending is None else pending)
        if heard:
            self.foresight.note_followed(now_s, self.followed if followed is None else followed)
        silent = self._update_presence(now_s)
        crowded, numbers = self._crowds.step(now_s), self._crowds.numbers
        self._sweep.sweeper.touch(crowded)
        updated, self._updated, returned = self._updated, set(), self.presence.take_returned()
        reach_s = self.site.conflict.warning_s if effort >= Effort.NEAR else inf
        dormant = self._let_sleep(now_s)
        conflicts = self._sweep.find_conflicts(now_s, reach_s, COARSE_M if effort >= Effort.COARSE else ACCURACY_M)
        self.near_misses = [pair for pair in self._trigger.new_pairs(conflicts) if self._is_near_miss(pair)]
        predictions = self._predictions(now_s, conflicts).until(now_s + reach_s)
        revisions: list[AnyAdvisory] = [*self._conflicts.dismiss(crowded, numbers, ClearedCode.CROWDED, now_s)]
        revisions += self._conflicts.dismiss(dormant, self._sweep.dormant, ClearedCode.BOTH_SILENT, now_s)
        revisions += self._conflicts.revise(now_s, predictions, updated, self._scene, now_s + reach_s, returned)
        revisions += self._conflicts.mark_silent(silent, now_s, self._scene)
        revisions += self._advice.add_holds(now_s, self._conflicts)
        revisions += self._shared.step(now_s, effort)
        self._advice.burden.charge(revisions)
        if heard:
            self.foresight.note_advice(now_s, waits_until_s(revisions))
        self.losses = self._placed_losses(now_s, revisions)
        counted = self.near_misses, revisions, self._conflicts.budget.deferred
        self._metrics.count_pass(conflicts, self._are_on_foot, *counted)
        count_losses(self.measures, self.losses)
        return revisions

    def advise(
        self, now_s: float, answers: Iterable[AnsweredAdvice] = (), effort: Effort = Effort.FULL
    ) -> list[RobotAdvice]:
        """What is asked of robots, and what changed of it since the last call. Call it after `step`: it delays nothing.

        `answers` are those that came since the last call. With `Effort.NEAR` all is withdrawn: warnings come first.
        """
        revisions = self._shared.advise(now_s, answers, effort)
        self.refusals = [self._placed_refusal(refusal) for refusal in self._shared.asked.refusals.take()]
        self.followed = self._shared.asked.take_followed()
        return revisions

    def withdraw_advice(self, now_s: float) -> list[RobotAdvice]:
        """End all that is asked of robots, after `advise` has raised an error."""
        self.followed = []
        return self._shared.withdraw_advice(now_s)

    def _placed_refusal(self, refusal: AdviceRefusal) -> AdviceRefusal:
        """A refusal with the models and places of the robots that it held up."""
        live, place_at = self.live.robots, self._loss_places.place_at
        models = {uuid: row.batch.models[row.row] for other in refusal.others if (row := live.get(uuid := other.robot))}
        return replace(
            refusal,
            others=tuple(
                other._replace(model=models.get(other.robot, ""), place=place_at(other.datum, other.x_m, other.y_m))
                for other in refusal.others
            ),
        )

    def _placed_losses(self, now_s: float, revisions: Sequence[AnyAdvisory]) -> list[PlacedLoss]:
        """The losses that ended, with their places and what had been published when they began."""
        losses = self._loss_places.placed(self.foresight.losses.take(), self.floors.names)
        if self._conflicts_only:
            return losses
        self._loss_warnings.note(now_s, revisions)
        return [placed._replace(notice=self._loss_warnings.notice_of(placed.loss)) for placed in losses]

    def _update_presence(self, now_s: float) -> set[str]:
        """Update how likely silent robots are still present; those that have fallen silent since the last pass."""
        changes = self.presence.advance(now_s)
        for uuid, probability in changes.there.items():
            self.foresight.set_presence(uuid, probability)
        self.foresight.mark_silent(changes.silent)
        if changes.stopped:
            self._add(presence_batches.stopped_batch(self.live, changes.stopped, now_s))
        self._shared.update_presence(changes, now_s)
        return changes.silent

    def _let_sleep(self, now_s: float) -> set[str]:
        """The robots that have stood for so long that only a report changes anything."""
        dormant = self._sweep.grow_quiet(now_s)
        self.live.set_aside(dormant)
        self.foresight.let_sleep(dormant, now_s)
        return dormant

    def _partly_examined(self) -> Counter[str]:
        """By vendor, how many robots are compared with some others only."""
        return Counter(self.live.robots[uuid].vendor for uuid in self.claims.partly_examined())

    def _is_near_miss(self, pair: Pair) -> bool:
        return not (all(map(self._scene.stands, pair)) or self._are_on_foot(pair))

    def _are_on_foot(self, pair: Pair) -> bool:
        """Whether both are people on foot: nobody warns them of each other."""
        return pair[0] in self.live.on_foot and pair[1] in self.live.on_foot

    def _predictions(self, now_s: float, conflicts: PairConflicts) -> Predictions:
        """The pairs in conflict by the sweep, and those that are likely to be although it does not say so, without
        those of two people on foot."""
        swept = SweptConflicts(conflicts.pairs, conflicts.separation_m, conflicts.separation_at_s, conflicts.contact_s)
        predictions, n = self.foresight.estimate(now_s, swept, held_probability(self.site.conflict)), len(swept.pairs)
        predictions.contact_s[:n], predictions.separation_m[:n] = conflicts.contact_s, conflicts.separation_m
        predictions.start_separation_m[:n], predictions.fresh[:n] = conflicts.start_separation_m, conflicts.fresh
        predictions = predictions._replace(both_present=self.presence.silences.both_there(predictions.pairs))
        return predictions.without(self._are_on_foot) if self.live.on_foot else predictions

    def probabilities(self) -> list[tuple[Pair, float]]:
        """The probability of every examined pair to come within the clearance within the horizon, after `step`."""
        return self.foresight.probabilities()

    def turns(self) -> Mapping[str, QueueForecast]:
        """By resource or zone, who has it or will have it, and from when to when, by the last look."""
        return self._shared.contention.queues

    def needs(self) -> Sequence[ChargingNeed]:
        """Robots that may need a charger and have not announced that they go to one."""
        return self._shared.contention.needs
