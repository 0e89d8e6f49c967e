"""How likely each pair of robots is to get in each other's way: from forecasts to probabilities.

`receive` takes in reports: it compares earlier forecasts with them, learns how far off forecasts are, and finds which
robots gave way to each other. `estimate` selects the pairs that are worth a look, measures them, drives robots on
together where they crowd, learns from known outcomes, and turns the features of each pair into a probability. That is
the probability that the two come within the clearance, or that one gives way to the other, as it holds on this site.
Outcomes are read from the robots' own reports, as in offline scoring.
"""

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from deconflict.foresight.conflict_predictions import Predictions
from deconflict.foresight.forecast_errors.degradation import DegradationDetector
from deconflict.foresight.forecast_errors.error_ledger import Ledger
from deconflict.foresight.forecast_errors.error_measures import measure
from deconflict.foresight.forecast_errors.pending_forecasts import PendingForecasts, ReportedTracks
from deconflict.foresight.forecast_errors.self_contradiction import (
    DoubtedRobots,
    blank_records,
    compare_with_stated_ways,
    straight_on,
)
from deconflict.foresight.forecast_errors.track_kernels import Errors, speed_mps
from deconflict.foresight.interactions.interaction_finder import Interaction, InteractionOutcome
from deconflict.foresight.interactions.progress_kernels import AHEAD_S as GIVES_WAY_AHEAD_S
from deconflict.foresight.losses.loss_finder import LossFinder
from deconflict.foresight.motion_assumptions import JOINED_S
from deconflict.foresight.probability.advice_followers import AdviceFollowers
from deconflict.foresight.probability.calibration import contact_features, log_odds
from deconflict.foresight.probability.error_band_kernels import Bounds, update_surprise
from deconflict.foresight.probability.outcome_learning import OutcomeLearning
from deconflict.foresight.probability.pair_candidates import PairCandidates, SweptConflicts
from deconflict.foresight.probability.pair_measuring import PairMeasuring
from deconflict.foresight.probability.pair_rollouts import PairRollouts
from deconflict.foresight.probability.pair_table import (
    PAIR,
    PREEMPTED_S,
    SETTLED_S,
    TOUCHING,
    has_robot_of,
    open_rows,
    row_of,
    rows_to_report,
    select_pairs,
    set_preemption,
    slots_of,
)
from deconflict.foresight.probability.tracked_robots import TrackedRobots
from deconflict.foresight.probability.waiting_robots import record_starts
from deconflict.foresight.rollout.rollout import NOBODY
from deconflict.foresight.rollout.start_times import StartTimes
from deconflict.sweep.geometry.encounter import STANDING_MPS
from deconflict.sweep.pair_choice import NO_CROWDS, Claims
from deconflict.sweep.robot_slots import RobotSlots
from deconflict_client.verbs import Followed
from ingest.batch import Batch, Bools, Floats, Ints, Pair
from ingest.kernels import ready
from ingest.measures.measures import Measures

STAYS_S = 20.0
"""A robot that has stood for at least this time is expected to stay."""
DISTRUSTED = 2.0
"""A robot contradicts its forecasts if, over a few reports, its errors a second ahead are this many 90 % bands."""

ESTIMATED = ("probability", "lower", "upper", "deciding", "contact_probability")
"""Fields of `PAIR` that are estimated: those of `Estimate` in its order, then that of contact, at most the first."""


class ProbabilityEstimator:
    """The robots, what is known of their forecasts, and the pairs under watch. Pure: the same calls give the same
    results."""

    def __init__(
        self,
        clearance_m: float,
        apart_m: float,
        horizon_s: float,
        measures: Measures,
        crowds: Mapping[str, int] = NO_CROWDS,
        claims: Claims | None = None,
        slots: RobotSlots | None = None,
        named: Collection[str] = (),
    ) -> None:
        """`crowds` has the robots in a crowd, and may change; for `claims` see `pair_choice`. `slots` are those of the
        robots, and maybe of others; without any each robot keeps its slot for good. `named` are the vendors of the
        site file: what is learned of any other counts for it alone, unless none is named."""
        self.measures = measures
        self.ledger = Ledger()
        """All errors of forecasts."""
        self.following = Ledger()
        """Errors of robots that were on their way all the time."""
        self.degradation = DegradationDetector()
        self.start_times = StartTimes(self.ledger.kinds, lambda vendor: not named or vendor in named)
        self.learning = OutcomeLearning(horizon_s, measures)
        self.bounds = Bounds(clearance_m, apart_m, horizon_s)
        """The clearance and the horizon for which probabilities are learned."""
        own_slots = RobotSlots() if slots is None else slots
        self.robots = TrackedRobots(own_slots, crowds, self.start_times.counts_for_all)
        """The robots, and the numbers of their vendors."""
        self.pending = PendingForecasts()
        self._stated_ways, self._doubts = blank_records(0), DoubtedRobots()
        self.losses, self.followers = LossFinder(), AdviceFollowers()
        self._candidates = PairCandidates(self.robots, clearance_m, horizon_s, claims)
        self._measuring = PairMeasuring(self.bounds, self.robots, self.pending)
        self._rollouts = PairRollouts(clearance_m, horizon_s, self.robots, self.pending)
        self.pairs = np.zeros(0, PAIR)
        self._looked_s = float("-inf")
        measures.call_before_reading(self._measure)

    def receive(self, batch: Batch) -> Batch:
        """Compare earlier forecasts with the new reports, and keep the new forecasts.

        Returns the batch as it is believed: a robot that goes elsewhere than it says is taken to go straight on.
        """
        if batch.gone:
            self._resolve_left(batch.gone, were_present=True)
            self._forget(batch.gone)
        if not len(batch):
            return batch
        slots = self.robots.add(batch)
        self._grow(len(self.robots))
        announced, batch = batch, self._believed(batch, slots)
        kinds = (batch.vendors, batch.models, batch.basis.tolist(), batch.now_s)
        ledger_rows = np.array(self.ledger.rows(*kinds))
        self.following.add_kinds(self.ledger, batch.now_s)
        self.robots.update(slots, batch)
        reports = ReportedTracks.of(batch, slots, ledger_rows)
        self._record_errors(self._compare(reports, batch.now_s), batch.now_s)
        self._find_interactions(batch, reports)
        self._doubts.note(slots, announced, contradict := self._contradicts(slots))
        for row in contradict.nonzero()[0].tolist():
            self.measures.count("deconflict_forecasts_distrusted_total", batch.vendors[row])
        return batch

    def _believed(self, batch: Batch, slots: Ints) -> Batch:
        f = batch.forecasts
        t_s, x_m, y_m = ready(f.t_s), ready(f.x_m), ready(f.y_m)
        start, floor = ready(f.start, np.int64), ready(f.floor, np.int64)
        rows = compare_with_stated_ways(self._stated_ways, slots, start, t_s, x_m, y_m, floor)
        return straight_on(batch, rows, slots[rows], self._stated_ways, self.bounds.horizon_s) if len(rows) else batch

    def _compare(self, reports: ReportedTracks, now_s: float) -> Errors:
        """The errors of earlier forecasts that the reports show. Robots that wait as advised have none: their earlier
        forecasts are not held against them."""
        slots, robots = reports.slot, self.robots.records
        before, before_s = robots[slots], self.pending.newest[slots, 0]
        errors, stand = self.pending.add_reports(robots, self.robots.half_m, reports, self.ledger.bands_m)
        followers = self.followers.record_waits(slots, stand, self.pending.newest, self.robots.half_m)
        if len(followers):
            self.pending.drop_forecasts(followers)
            errors = errors[~np.isin(errors["robot"], followers)]
        blocked, newest_s = self._rollouts.schedule.waits_for[slots] != NOBODY, self.pending.newest[slots, 0]
        record_starts(self.start_times, before, robots[slots], blocked, before_s, newest_s, now_s)
        return errors

    def _record_errors(self, errors: Errors, now_s: float) -> None:
        self.ledger.record(errors, now_s)
        on_their_way = errors[errors["following"]]
        self.following.record(on_their_way, now_s)
        self.degradation.add_errors(errors, self.ledger.kinds, now_s)
        update_surprise(self.robots.records, on_their_way)

    def _find_interactions(self, batch: Batch, reports: ReportedTracks) -> None:
        """Find which robots gave way to each other, by the reports of a batch, and note it in their pairs."""
        usual_m = self.following.bands_m[reports.kind, :GIVES_WAY_AHEAD_S, 2]
        robots, reported = self.robots, (reports.slot, reports.track, usual_m)
        bodies, is_crowded = (robots.half_m, robots.levels_m), robots.is_crowded()
        for interaction in self.losses.receive(batch, *reported, *bodies, robots.vendor, is_crowded):
            self._note_interaction(interaction)

    def _note_interaction(self, interaction: Interaction) -> None:
        row = row_of(self.pairs, self.robots.pair_code(interaction.robot, interaction.other))
        if row is None:
            return
        pair = self.pairs[row]
        is_over = interaction.end_s < float("inf")
        pair["gives_way"] = not is_over
        if interaction.outcome is InteractionOutcome.YIELDED:
            if not interaction.again:
                pair["yielded_s"] = interaction.onset_s
            pair["yield_end_s"] = interaction.end_s
        pair["uncertain_s"] = interaction.onset_s if interaction.outcome is InteractionOutcome.UNKNOWN else -np.inf

    def estimate(self, now_s: float, swept: SweptConflicts, likely: float) -> Predictions:
        """Look at the pairs of which something is new, and learn from the outcomes that have become known.

        Returns the pairs of the exact sweep in its order, then other pairs whose `deciding` is at least `likely`. The
        columns are copies: `contact_s` and `separation_m` are of the nearest moment within the horizon, `both_present`
        is 1.
        """
        swept_codes, has_news = self._candidates.codes_of(swept.pairs), self.robots.take_news()
        known = self.pending, self.ledger.bands_m
        nearby_codes = self._candidates.nearby_codes(has_news, *known, now_s, self.pairs)
        candidates = np.concatenate([swept_codes, nearby_codes])
        pairs, fresh, rows, due = select_pairs(self.pairs, candidates, has_news, self.robots.is_dormant, now_s)
        self.pairs, swept_rows, self._looked_s = pairs, rows[: len(swept_codes)], now_s
        self._measuring.measure(
            pairs, due, swept, swept_rows, bands_m=self.following.bands_m, start_times=self.start_times,
            is_blocked=self._rollouts.is_blocked, now_s=now_s,
        )  # fmt: skip
        self._rollouts.run_due(pairs, due, self.start_times, now_s)
        self.learning.learn(now_s, pairs, self._own_until_s, self.robots)
        self._set_probabilities(now_s)
        if self.learning.is_due(now_s):
            asked = pairs[open_rows(pairs, self.pending.newest, now_s - JOINED_S)]
            asked = self._candidates.worth_learning_from(asked)
            self.learning.ask(now_s, asked["code"], asked["features"])
        rows, other_codes = rows_to_report(pairs, swept_rows, likely)
        return Predictions(
            pairs=[*swept.pairs, *self.robots.pair_names(other_codes)],
            contact_s=pairs["near_s"][rows],
            separation_m=pairs["near_m"][rows],
            start_separation_m=pairs["now_m"][rows],
            fresh=fresh[rows],
            both_present=np.ones(len(rows)),
            **{name: pairs[name][rows] for name in (*ESTIMATED, "still")},
        )

    def _set_probabilities(self, now_s: float) -> None:
        """Set the probabilities of the watched pairs, from their features and from the other pairs of their robots."""
        pairs, robots = self.pairs, self.robots
        stands, crowded, records = robots.is_standing(slice(None)), robots.is_crowded(), robots.records
        stays = records["stays"] | (now_s - records["stood_since_s"] >= STAYS_S)
        set_preemption(pairs, stands, stays, self._rollouts.schedule.waits_for, crowded, now_s, PREEMPTED_S, SETTLED_S)
        rows = np.flatnonzero(pairs["watched"])
        features, code = pairs["features"][rows], pairs["code"][rows]
        vendors, present = robots.pair_vendors(code), robots.both_present(code)
        contact = self.learning.contact.estimate(contact_features(features), vendors).probability
        features[:, TOUCHING] = pairs["features"][rows, TOUCHING] = log_odds(contact)
        estimate = self.learning.calibration.estimate(features, vendors)
        for name, column in zip(ESTIMATED, (*estimate, np.minimum(contact, estimate.probability)), strict=True):
            pairs[name][rows] = column * present

    def probabilities(self) -> list[tuple[Pair, float]]:
        """The probability of every watched pair in no encounter of which both robots are heard, as of the last look."""
        return self._of_heard("probability")

    def contact_probabilities(self) -> list[tuple[Pair, float]]:
        """The same pairs with the probability of coming within the clearance alone."""
        return self._of_heard("contact_probability")

    def _of_heard(self, column: str) -> list[tuple[Pair, float]]:
        """What a column of the table has of each pair in no encounter of which both robots are heard."""
        rank, rows = self.robots.slots.ranks(), open_rows(self.pairs, self.pending.newest, self._looked_s - JOINED_S)
        a, b = slots_of(self.pairs["code"][rows])
        heard = self.pairs[rows[np.argsort(rank[a] * len(rank) + rank[b])]]
        return list(zip(self.robots.pair_names(heard["code"]), heard[column].tolist(), strict=True))

    def note_advice(self, now_s: float, until_s: Mapping[str, float]) -> None:
        """Robots are advised to wait until these times, by UUID."""
        for uuid, wait_until_s in until_s.items():
            if (slot := self.robots.slot_of(uuid)) is not None:
                stands = self.robots.records["rests"][slot] or speed_mps(self.pending.history, slot) < STANDING_MPS
                self.followers.note_advice(slot, now_s, wait_until_s, bool(stands))

    def note_followed(self, now_s: float, followed: Iterable[Followed]) -> None:
        """Robots do what they were asked, each with that for which it was asked."""
        for robot, other in followed:
            if (code := self.robots.code_of(robot, other)) is not None:
                self.followers.note_followed(code, now_s)

    def following_advice(self, now_s: float) -> list[str | Pair]:
        """UUIDs of the robots that wait as advised, by their newest reports, and the pairs of which one robot does what
        it was asked for the other."""
        robots = sorted(self.robots.slots.names(self.followers.waiting(now_s - JOINED_S)))
        return [*robots, *sorted(self.robots.pair_names(self.followers.followed(now_s - JOINED_S)))]

    def last_advised_wait_s(self, uuid: str) -> float:
        """When a robot was last seen to wait as advised; -inf if it never was."""
        return self.followers.last_wait_s(self.robots.slot_of(uuid))

    def has_followed(self, robot: str, other: str, at_s: float) -> bool:
        """Whether one of two robots did what it was asked for the other at `at_s`."""
        return (code := self.robots.code_of(robot, other)) is not None and self.followers.has_followed(code, at_s)

    def is_standing(self, uuid: str) -> bool:
        """Whether a robot stands, by its forecast or by its reports. False for an unknown robot."""
        return bool(self.robots.is_standing(self.robots.slots_of((uuid,))).any())

    def is_distrusted(self, uuid: str) -> bool:
        """Whether a robot's forecasts contradict its own motion. False for an unknown robot."""
        return (slot := self.robots.slot_of(uuid)) is not None and bool(self._contradicts(slot))

    def distrusted(self) -> list[str]:
        """UUIDs of the robots to name as those that move otherwise than they announce, in ascending order."""
        return sorted(self.robots.slots.names(self._doubts.named(self._looked_s)))

    def _contradicts(self, slots: int | Ints | slice) -> Bools:
        """Which robots of `slots`, or whether that of one slot, contradict their forecasts by their motion."""
        surprise, contradiction = self.robots.records["surprise"], self._stated_ways["contradiction"]
        return (surprise[slots] > DISTRUSTED) | (contradiction[slots] > 1.0)

    def _measure(self) -> None:
        measure(self.ledger, self.measures)
        vendors, of_robots = self.robots.vendor_numbers, self.robots.vendor[self._doubts.named(self._looked_s)]
        counts = np.bincount(of_robots, minlength=len(vendors)).tolist()
        self.measures.level("deconflict_robots_distrusted", {(name,): counts[row] for name, row in vendors.items()})

    def set_presence(self, uuid: str, probability: float) -> None:
        """Set the probability that a robot is present."""
        self.robots.absence[self.robots.slots_of((uuid,))] = 1.0 - probability

    def let_sleep(self, uuids: Collection[str], now_s: float) -> None:
        """These robots stand until they report: no pair of two such robots is watched, and later they rest."""
        resting = self.robots.let_sleep(uuids, now_s, self.pending.newest[:, 0])
        self.pending.rest(resting)
        for interaction in self.losses.rest(resting):
            self._note_interaction(interaction)

    def mark_silent(self, uuids: Collection[str]) -> None:
        """Robots have fallen silent. Whether one of them still gives way, or another robot to it, is not known."""
        slots = self.robots.slots_of(uuids)
        if len(slots):
            is_theirs = has_robot_of(self.pairs["code"], slots)
            self.pairs["gives_way"][is_theirs], self.pairs["gave_way_s"][is_theirs] = False, -np.inf

    def resolve_absent(self, uuids: Collection[str]) -> None:
        """Silent robots turned out to be absent. The open questions about their pairs are answered: none met."""
        if uuids:
            self._resolve_left(uuids, were_present=False)

    def _resolve_left(self, uuids: Collection[str], were_present: bool) -> None:
        slots = self.robots.slots_of(uuids)
        self.learning.questions.resolve_left(slots, self.pairs, self._own_until_s, were_present=were_present)

    def _own_until_s(self, code: Ints, asked_s: float) -> Floats:
        """(p,) until when both robots of each pair were heard and drove unadvised."""
        return self.followers.own_until_s(self.pending.newest, code, asked_s, self.bounds.horizon_s)

    def _grow(self, slots: int) -> None:
        more = slots - len(self._stated_ways)
        if more > 0:
            self._stated_ways = np.concatenate([self._stated_ways, blank_records(more)])
            for table in (self.pending, self._doubts, self._rollouts.schedule, self.losses, self.followers):
                table.grow(slots)

    def _forget(self, uuids: Collection[str]) -> None:
        if not len(slots := self.robots.remove(uuids)):
            return
        self._stated_ways[slots] = blank_records(len(slots))
        for table in (self.pending, self._doubts, self._rollouts.schedule, self.losses, self.followers):
            table.forget(slots)
        a, b = slots_of(self.pairs["code"])
        self.pairs = self.pairs[self.robots.is_used[a] & self.robots.is_used[b]]
