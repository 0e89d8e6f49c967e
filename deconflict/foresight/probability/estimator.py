"""How likely each pair of robots is to get in each other's way, from what their forecasts were worth so far.

At each look a pair's separation is sampled over the horizon. At each sample the share of the two robots' error
distributions (the 80 % bands of robots that are on their way, taken as those of a normal one) that lies within the
clearance is a first guess. Robots that wait start at a time that is learned. `calibration` makes of these the
probability that holds on this site: that they come within the clearance, or that one gives way to the other.
OpenQuestions are read from the robots' own reports, as in offline scoring.
"""

from collections.abc import Collection, Mapping, Sequence
from itertools import repeat
from math import floor
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from deconflict.foresight.forecast_errors.degradation import DegradationDetector
from deconflict.foresight.forecast_errors.error_measures import measure
from deconflict.foresight.forecast_errors.ledger import Ledger
from deconflict.foresight.forecast_errors.pending_forecasts import JOINED_S, PendingForecasts, ReportedTracks
from deconflict.foresight.forecast_errors.self_contradiction import hold_to_word, straight_on, unheard
from deconflict.foresight.forecast_errors.track_kernels import ROBOT, Errors
from deconflict.foresight.interactions.interaction_finder import Interaction, InteractionFinder, InteractionOutcome
from deconflict.foresight.interactions.progress_kernels import AHEAD_S as GIVES_WAY_AHEAD_S
from deconflict.foresight.interactions.report_progress import interaction_reports
from deconflict.foresight.probability.advice_followers import AdviceFollowers
from deconflict.foresight.probability.band_kernels import judge, reach_m, wonder
from deconflict.foresight.probability.calibration import CONTACT, Calibration, contact_features, log_odds
from deconflict.foresight.probability.pair_table import (
    DRIVEN,
    PAIR,
    PREEMPTED_S,
    SETTLED_S,
    TOUCHING,
    OpenQuestions,
    Pairs,
    again,
    codes,
    crowded,
    of_robots,
    open_rows,
    preempt,
    shown,
    slots_of,
)
from deconflict.foresight.probability.start_times import StartTimes
from deconflict.foresight.probability.waiting_robots import heard, mixed, waits
from deconflict.foresight.rollout.rollout import NOBODY, RolloutInput, run_rollout
from deconflict.foresight.rollout.rollout_schedule import RolloutSchedule
from deconflict.foresight.rollout.start_samples import SAMPLES, START, key_of, quantiles
from deconflict.runtime.learned_state import Part
from deconflict.sweep.geometry.encounter import STANDING_MPS
from deconflict.sweep.geometry.rectangles import signed_gap
from ingest.batch import Batch, Bools, Floats, Ints, Pair
from ingest.kernels import ready
from ingest.measures.measures import Labels, Measures

LOOKS: Floats = np.concatenate([np.arange(0.0, 5.0, 0.5), np.arange(5.0, 11.0)])
"""Parts of ten at which the horizon is sampled."""
PAST_LOOKS: Floats = np.arange(1, 6) / 5
MOST_GROWN_M = 0.75
"""An envelope is grown by its 80 % band at the horizon, but no more, to find the pairs to watch."""
STAYS_S = 20.0
"""A robot that has stood for so long is not expected to set out any moment."""
DISTRUSTED = 2.0
"""A robot whose errors a second ahead are so many 90 % bands, faded over a few reports, contradicts its forecasts."""


SHOWN = frozenset(PAIR.names or ())
"""Columns of pairs that are shown."""


ESTIMATED = ("probability", "lower", "upper", "deciding", "contact_probability")
"""Columns of pairs that are estimated, in the order of `Estimate`, and that of contact."""


BY_SLOT = "_held", "_told", "_robots", "_rank", "_half", "_levels_m", "_vendor", "_absence", "_key"
"""Columns of a foresight; those of its parts grow by themselves."""


class SweptConflicts(NamedTuple):
    """What the exact sweep found: c pairs whose forecasts come within the clearance. Arrays are (c,)."""

    pairs: Sequence[Pair]
    before: Ints
    """The place of each among those of the last look; -1 where it is not known to be one."""
    separation_m: Floats
    separation_at_s: Floats
    contact_s: Floats


class PairEstimates(NamedTuple):
    """What is thought of w pairs; arrays are (w,) and the caller's own. Those of the exact sweep come first, in its
    order."""

    pairs: Sequence[Pair]
    probability: Floats
    near_s: Floats
    near_m: Floats
    now_m: Floats
    """Separation when last looked at, by the newest forecasts."""
    fresh: Bools
    """Whether either robot has reported since the last look."""
    contact_probability: Floats
    """That the envelopes come within the clearance."""
    lower: Floats
    """Ends of the interval of the probability."""
    upper: Floats
    deciding: Floats
    """What alerts are decided by."""
    still: Bools
    """Both stay where they stand, or one gave way to the other lately: there is nothing to alert of."""


class ProbabilityEstimator:
    """Ledger, calibration and the pairs under watch. Pure: the same calls give the same answers."""

    def __init__(self, clearance_m: float, margin_m: float, horizon_s: float, measures: Measures) -> None:
        self.ledger, self.calibration, self.measures = Ledger(), Calibration(), measures
        self.contact = Calibration(CONTACT)
        """Of coming within the clearance alone."""
        self.following = Ledger()
        """Errors of robots that were on their way all the time."""
        self.start_times = StartTimes()
        self._finder = InteractionFinder()
        measures.ask(self._measure)
        self.degradation = DegradationDetector()
        self._clearance_m, self._margin_m = clearance_m, margin_m
        self._ahead_s = LOOKS * (horizon_s / LOOKS[-1])
        self._horizon_s = horizon_s
        self._followed = PendingForecasts()
        self._outcomes = OpenQuestions(horizon_s)
        self._heeded = AdviceFollowers()
        self._slots: dict[str, int] = {}
        self._names: list[str] = []
        self._spare: list[int] = []
        self._robots = np.zeros(0, ROBOT)
        self._words = unheard(0)
        self._rank = np.zeros(0, np.int64)
        """By UUID; pairs are named in its order."""
        self._ranks_stale = False
        self._held = np.zeros(0, np.bool_)
        """Whether a robot has the slot."""
        self._told = np.zeros(0, np.bool_)
        """Whether it has a new forecast since the last look."""
        self._half = np.zeros((2, 0))
        self._levels_m = np.zeros((2, 0))
        """Bottom and top."""
        self._vendor = np.zeros(0, np.int64)
        """Place among `_vendors`."""
        self._vendors: dict[str, int] = {}
        self._absence = np.zeros(0)
        """(slots,) how likely a robot that is silent is not there."""
        self._key = np.zeros(0, np.int64)
        self._rollouts = RolloutSchedule()
        self._pairs = np.zeros(0, PAIR)
        self._swept: Ints = np.full(1, -1)
        """Codes of the pairs that were swept in the last look, -1 where a robot left since; and -1 at the end, for one
        that was not swept."""
        self._asked_s = self._looked_s = float("-inf")

    def learned(self) -> dict[str, Part]:
        """What is worth keeping over a restart; probabilities hold for the clearance and horizon of their learning."""
        asked = {"clearance_m": self._clearance_m, "horizon_s": self._horizon_s}
        return {
            "ledger": self.ledger.learned(),
            "following": self.following.learned(),
            "starts": self.start_times.learned(),
            "calibration": self.calibration.learned() | asked | {"vendor_names": list(self._vendors)},
            "contact": self.contact.learned() | asked,
            "changes": self.degradation.learned(),
        }

    def resume(self, parts: Mapping[str, Part]) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        self.ledger.resume(parts.get("ledger", {}))
        self.degradation.resume(parts.get("changes", {}))
        if "following" in parts:
            self.following.resume(parts["following"])
            self.start_times.resume(parts.get("starts", {}))
        known = parts.get("calibration", {})
        if "vendor_names" in known and self._is_of_this(known):
            self._vendors = {str(name): place for place, name in enumerate(known["vendor_names"])}
            self.calibration.resume(known)
        if self._is_of_this(parts.get("contact", {})):
            self.contact.resume(parts["contact"])

    def _is_of_this(self, part: Part) -> bool:
        """Whether a part was learned with this clearance and horizon."""
        return bool((part.get("clearance_m"), part.get("horizon_s")) == (self._clearance_m, self._horizon_s))

    def receive(self, batch: Batch) -> Batch:
        """Hold earlier forecasts against the new reports, and keep the new forecasts.

        The batch as it is believed: a robot that goes elsewhere than it says is taken to go straight on.
        """
        if batch.gone:
            self._settle(batch.gone, were_there=True)
            self._forget(batch.gone)
        if not len(batch):
            return batch
        slots = np.fromiter(map(self._slots.get, batch.robots, repeat(-1)), np.int64, len(batch))
        for row in np.flatnonzero(slots < 0).tolist():
            slots[row] = self._slot(batch.robots[row])
        if self._ranks_stale:
            self._rank_anew()
        batch = self._believed(batch, slots)
        of_kinds = batch.vendors, batch.models, batch.basis.tolist(), batch.now_s
        kinds = np.array(self.ledger.rows(*of_kinds))
        self.following.rows(*of_kinds)
        self._told[slots] = True
        self._levels_m[:, slots] = batch.forecasts.bottom_m, batch.forecasts.top_m
        self._vendor[slots] = [self._vendors.setdefault(vendor, len(self._vendors)) for vendor in batch.vendors]
        reports = ReportedTracks.of(batch, slots, kinds)
        before, before_s = self._robots[slots], self._followed.seen[slots, 0]
        errors = self._own(reports, *self._followed.add_reports(self._robots, self._half, reports, self.ledger.bands_m))
        blocked, moments_s = self._rollouts.waits_for[slots] != NOBODY, (before_s, self._followed.seen[slots, 0])
        heard(self.start_times, before, self._robots[slots], blocked, *moments_s, batch.now_s)
        self.ledger.record(errors, batch.now_s)
        on_their_way = errors[errors["following"]]
        self.following.record(on_their_way, batch.now_s)
        self.degradation.add_errors(errors, self.ledger.kinds, batch.now_s)
        wonder(self._robots, on_their_way)
        self._interact(batch, reports)
        for row in self._contradict(slots).nonzero()[0].tolist():
            self.measures.count("deconflict_forecasts_distrusted_total", batch.vendors[row])
        return batch

    def _interact(self, batch: Batch, reports: ReportedTracks) -> None:
        """Find who gave way to whom, by the reports of a batch, and note it of their pairs."""
        usual_m = self.following.bands_m[reports.kind, :GIVES_WAY_AHEAD_S, 2]
        seen = interaction_reports(batch, reports.slot, reports.track, usual_m)
        for interaction in self._finder.receive(seen, self._half, self._levels_m, self._vendor):
            self._note(interaction)

    def _note(self, interaction: Interaction) -> None:
        code = self._code(interaction.robot, interaction.other)
        row = int(np.searchsorted(self._pairs["code"], code))
        if row == len(self._pairs) or self._pairs["code"][row] != code:
            return
        pair = self._pairs[row]
        over = interaction.end_s < float("inf")
        pair["gives_way"] = not over
        if interaction.outcome is InteractionOutcome.YIELDED:
            if not interaction.again:
                pair["yielded_s"] = interaction.onset_s
            pair["yield_end_s"] = interaction.end_s
        pair["doubted_s"] = interaction.onset_s if interaction.outcome is InteractionOutcome.UNKNOWN else -np.inf

    def _code(self, slot: int, other: int) -> int:
        """The number of a pair of slots."""
        a, b = (slot, other) if self._rank[slot] < self._rank[other] else (other, slot)
        return int(codes(np.array([a]), np.array([b]))[0])

    def _believed(self, batch: Batch, slots: Ints) -> Batch:
        f = batch.forecasts
        t_s, x_m, y_m = ready(f.t_s), ready(f.x_m), ready(f.y_m)
        rows = hold_to_word(self._words, slots, ready(f.start, np.int64), t_s, x_m, y_m, ready(f.floor, np.int64))
        return straight_on(batch, rows, slots[rows], self._words, self._horizon_s) if len(rows) else batch

    def _contradict(self, slots: Ints | slice) -> Bools:
        """Which robots of `slots` contradict their forecasts by their motion."""
        told: Bools = (self._robots["surprise"][slots] > DISTRUSTED) | (self._words["contradicts"][slots] > 1.0)
        return told

    def note_advice(self, now_s: float, until_s: Mapping[str, float]) -> None:
        """Robots should wait until then, by advice that stands."""
        for uuid in until_s.keys() & self._slots.keys():
            slot = self._slots[uuid]
            stands = self._robots["rests"][slot] or self._followed.speed_mps(slot) < STANDING_MPS
            self._heeded.advise(slot, now_s, until_s[uuid], bool(stands))

    def robots_following_advice(self, now_s: float) -> list[str]:
        """Robots that wait as advised, by what was last heard of them."""
        return sorted(self._names[slot] for slot in self._heeded.waiting(now_s - JOINED_S).tolist())

    def _own(self, reports: ReportedTracks, errors: Errors, stand: Bools) -> Errors:
        """The errors without those of robots that wait as advised, of which no earlier forecast is held to account."""
        waits = self._heeded.see(reports.slot, reports.event_s, stand)
        if not len(waits):
            return errors
        self._followed.disown(waits)
        own: Errors = errors[~np.isin(errors["robot"], waits)]
        return own

    def is_distrusted(self, uuid: str) -> bool:
        """Whether a robot's forecasts contradict its own motion."""
        slot = self._slots.get(uuid)
        return slot is not None and bool(self._contradict(slice(slot, slot + 1))[0])

    def _measure(self) -> None:
        measure(self.ledger, self.measures)
        self.measures.level("deconflict_robots_distrusted", self._distrusted())

    def _distrusted(self) -> dict[Labels, float]:
        """By vendor, robots whose forecasts contradict their own motion."""
        kinds = list(self.ledger.kinds)
        told: dict[Labels, float] = {(kind.vendor,): 0.0 for kind in kinds}
        for slot in np.flatnonzero(self._contradict(slice(None))).tolist():
            told[kinds[self._robots["kind"][slot]].vendor,] += 1
        return told

    def probabilities(self) -> list[tuple[Pair, float]]:
        """The standing probability of every pair under watch that is not in an encounter, both robots being heard."""
        pairs, since_s = self._pairs, self._looked_s - JOINED_S
        shown = pairs[open_rows(pairs, self._followed.seen, since_s)]
        a, b = slots_of(shown["code"])
        shown = shown[np.argsort(self._rank[a] * len(self._rank) + self._rank[b])]
        return list(zip(self._named(shown["code"]), shown["probability"].tolist(), strict=True))

    def contact_probabilities(self) -> list[tuple[Pair, float]]:
        """As `probabilities`, of coming within the clearance alone."""
        known, pairs = (
            dict(zip(self._pairs["code"].tolist(), self._pairs["contact_probability"].tolist(), strict=True)),
            [],
        )
        for (a, b), _ in self.probabilities():
            pairs.append(((a, b), known[self._code(self._slots[a], self._slots[b])]))
        return pairs

    def is_standing(self, uuid: str) -> bool:
        """Whether a robot stands, by its forecast or by its reports."""
        slot = self._slots.get(uuid)
        return slot is not None and bool(self._standing(slice(slot, slot + 1))[0])

    def _standing(self, slots: slice | Ints) -> Bools:
        robots = self._robots[slots]
        stands: Bools = robots["stays"] | (robots["stood_since_s"] < np.inf)
        return stands

    def estimate(self, now_s: float, swept: SweptConflicts, likely: float) -> PairEstimates:
        """Look again at what changed, and learn from what has become known.

        Tells of the swept pairs, and of others whose probability is at least `likely`.
        """
        exact = self._exact(swept)
        self._swept = np.append(exact, -1)
        told, self._told = self._told, np.zeros(len(self._told), np.bool_)
        near = self._near(told, now_s) if told.any() else np.empty(0, np.int64)
        self._pairs, fresh, rows, due = again(self._pairs, np.concatenate([exact, near]), told, now_s)
        pairs, swept_rows, self._looked_s = self._pairs, rows[: len(exact)], now_s
        self._examine(due, now_s, swept_rows, swept)
        self._roll(now_s, due)
        self._learn(now_s)
        self._estimate(pairs)
        self._ask(now_s)
        rows, others = shown(pairs, swept_rows, likely)
        columns = {name: pairs[name][rows] for name in PairEstimates._fields if name in SHOWN}
        return PairEstimates(pairs=[*swept.pairs, *self._named(others)], fresh=fresh[rows], **columns)

    def _roll(self, now_s: float, due: Ints) -> None:
        """Drive robots on together whose turn it is, and set what is seen of pairs by that."""
        a, b = slots_of(self._pairs["code"][crowded(self._pairs, self._absence)])
        slots = self._rollouts.due(a, b, self._key, now_s)
        if len(slots):
            slots = slots[np.argsort(self._rank[slots])]  # so that the answer does not hang on who came first
            rolled = run_rollout(self._crowd(slots, now_s), self._horizon_s, self._clearance_m)
            swap = self._rank[rolled.a] > self._rank[rolled.b]
            code = codes(np.where(swap, rolled.b, rolled.a), np.where(swap, rolled.a, rolled.b))
            self._rollouts.store(slots, rolled, code, now_s)
            due = np.union1d(due, np.flatnonzero(of_robots(self._pairs["code"], slots)))
        self._pairs["seen"][due, DRIVEN] = self._rollouts.seen_of(self._pairs["code"][due])

    def _crowd(self, slots: Ints, now_s: float) -> RolloutInput:
        robots, seen = self._robots[slots], self._followed.seen[slots]
        waiting = np.flatnonzero(waits(robots))
        stood_s = now_s - robots["stood_since_s"][waiting]
        starts_s = np.zeros((SAMPLES, len(slots)))
        part = quantiles(self._key[slots[waiting]], START)
        starts_s[:, waiting] = self.start_times.late_s(robots["kind"][waiting], stood_s, part)
        return RolloutInput(
            slots,
            self._key[slots],
            now_s - seen[:, 0],
            self._followed.track[slots],
            np.ascontiguousarray(self._half[:, slots]),
            np.ascontiguousarray(self._levels_m[:, slots]),
            self._standing(slots),
            starts_s,
        )

    def _estimate(self, pairs: Pairs) -> None:
        """Set how likely the pairs are, from what is seen of them and of their robots' other pairs."""
        stands, now_s = self._standing(slice(None)), self._looked_s
        stays = self._robots["stays"] | (now_s - self._robots["stood_since_s"] >= STAYS_S)
        preempt(pairs, stands, stays, self._rollouts.waits_for, now_s, PREEMPTED_S, SETTLED_S)
        rows = np.flatnonzero(pairs["watched"])
        seen, code = pairs["seen"][rows], pairs["code"][rows]
        vendors, there = self._vendors_of(code), self._both_there(code)
        contact = self.contact.estimate(contact_features(seen), vendors).probability
        seen[:, TOUCHING] = pairs["seen"][rows, TOUCHING] = log_odds(contact)
        estimate = self.calibration.estimate(seen, vendors)
        for name, column in zip(ESTIMATED, (*estimate, contact), strict=True):
            pairs[name][rows] = column * there

    def _vendors_of(self, code: Ints) -> Ints:
        """(n,) one number for the vendors of each pair."""
        a, b = (self._vendor[slots] for slots in slots_of(code))
        return codes(np.minimum(a, b), np.maximum(a, b))

    def _both_there(self, code: Ints) -> Floats:
        """(p,) how likely both robots of each pair `code` (p,) are there."""
        a, b = slots_of(code)
        both: Floats = (1.0 - self._absence[a]) * (1.0 - self._absence[b])
        return both

    def _exact(self, swept: SweptConflicts) -> Ints:
        """Codes of the pairs that were swept, most of them in the last look too."""
        exact = self._swept[swept.before]
        new = np.flatnonzero(exact < 0)
        if len(new):
            flat = np.array([self._slots[uuid] for row in new.tolist() for uuid in swept.pairs[row]])
            exact[new] = codes(flat[::2], flat[1::2])
        return exact

    def _named(self, code: Ints) -> list[Pair]:
        named, (a, b) = self._names.__getitem__, slots_of(code)
        return list(zip(map(named, a.tolist()), map(named, b.tolist()), strict=True))

    def _ask(self, now_s: float) -> None:
        if floor(now_s) > self._asked_s:
            self._asked_s = floor(now_s)
            asked = self._pairs[open_rows(self._pairs, self._followed.seen, now_s - JOINED_S)]
            self._outcomes.ask(now_s, asked["code"], asked["seen"])

    def _near(self, told: Bools, now_s: float) -> Ints:
        """Codes of the pairs, one of `told` in each, that may come near in the horizon, whole second by whole second.

        Envelopes are taken as circles, grown by the 80 % bands at the horizon.
        """
        slots = np.flatnonzero(self._held)
        of_robots = (slots, self._robots, self._half)
        near_m = reach_m(self.ledger.bands_m, *of_robots, self._clearance_m / 2, self._horizon_s, MOST_GROWN_M)
        a, b = self._followed.nearing(told, slots, self._rank, near_m, now_s, self._horizon_s).T
        bottom_m, top_m = self._levels_m
        level = (bottom_m[a] < top_m[b]) & (bottom_m[b] < top_m[a])
        return codes(a[level], b[level])

    def _examine(self, rows: Ints, now_s: float, swept_rows: Ints, swept: SweptConflicts) -> None:
        """Look at pairs of `rows`; the exact sweep found those of `swept_rows`."""
        pairs = self._pairs
        a, b = slots_of(pairs["code"][rows])
        beside = self._followed.beside(a, b, PAST_LOOKS, self._ahead_s, now_s)
        past_s, dx_m, dy_m, yaw_a_rad, yaw_b_rad, same, speed_mps = beside
        apart_m = signed_gap(dx_m, dy_m, yaw_a_rad, yaw_b_rad, self._half.take(a, axis=1), self._half.take(b, axis=1))
        exact = (swept_rows, swept.separation_m, swept.separation_at_s, swept.contact_s)
        of_robots = (self.following.bands_m, self._robots, self._followed.seen)
        limits = (now_s, self._horizon_s, self._clearance_m, self._margin_m, STANDING_MPS)
        sds = judge(pairs, rows, a, b, *exact, past_s, apart_m, same, speed_mps, *of_robots, self._ahead_s, *limits)
        bounds = (self._horizon_s, self._clearance_m)
        waits_for = self._rollouts.waits_for != NOBODY
        robots = (self._robots, self._half, self._followed, self.start_times, waits_for, self.following.bands_m)
        share = mixed(ndtr(sds), a, b, now_s, self._ahead_s, bounds, *robots)
        pairs["share"][rows] = share[0]
        pairs["seen"][rows, 1:3] = log_odds(share).T

    def _learn(self, now_s: float) -> None:
        for known in self._outcomes.known(now_s, self._pairs, self._own_until_s):
            vendors = self._vendors_of(known.code)
            self.calibration.learn(known.seen, vendors, known.interacted, now_s)
            self.contact.learn(contact_features(known.seen), vendors, known.touched, now_s)
            fates = known.interacted
            passed = ~fates.met & ~fates.left
            for name, count in (("met", fates.met), ("passed", passed), ("left", fates.left)):
                self.measures.count("deconflict_probability_outcomes_total", name, by=int(np.count_nonzero(count)))

    def _own_until_s(self, asked_s: float) -> Floats:
        """(slots,) until when each robot was heard and went its own way, after a moment."""
        return self._heeded.own_until_s(self._followed.seen, asked_s, self._horizon_s)

    def _slot(self, uuid: str) -> int:
        """A new robot's own, unless it has one already."""
        if uuid in self._slots:
            return self._slots[uuid]
        if self._spare:
            slot = self._spare.pop()
            self._names[slot] = uuid
        else:
            slot = len(self._names)
            self._names.append(uuid)
            if slot >= len(self._robots):
                self._grow(max(2 * slot, 16))
        self._slots[uuid], self._held[slot], self._key[slot] = slot, True, key_of(uuid)
        self._ranks_stale = True
        return slot

    def set_presence(self, uuid: str, there: float) -> None:
        """How likely a robot is there from now on."""
        if uuid in self._slots:
            self._absence[self._slots[uuid]] = 1.0 - there

    def mark_silent(self, uuids: Collection[str]) -> None:
        """Robots are heard no more: whether one still gives way to another, or the other to it, is not known."""
        slots = np.array([self._slots[uuid] for uuid in uuids if uuid in self._slots], np.int64)
        if len(slots):
            theirs = of_robots(self._pairs["code"], slots)
            self._pairs["gives_way"][theirs], self._pairs["gave_way_s"][theirs] = False, -np.inf

    def _rank_anew(self) -> None:
        self._ranks_stale = False
        self._rank[[self._slots[name] for name in sorted(self._slots)]] = np.arange(len(self._slots))

    def _grow(self, slots: int) -> None:
        more = slots - len(self._robots)
        for name in BY_SLOT:
            column = getattr(self, name)
            setattr(self, name, np.concatenate([column, np.zeros((*column.shape[:-1], more), column.dtype)], axis=-1))
        self._words = np.concatenate([self._words, unheard(more)])
        self._robots["stood_since_s"][-more:] = np.inf
        self._followed.grow(slots)
        self._rollouts.grow(slots)
        self._finder.grow(slots)
        self._heeded.grow(slots)

    def settle_absent(self, absent: Collection[str]) -> None:
        """Silent robots have turned out not to be there: what is not known of their pairs yet is that they were kept
        apart."""
        if absent:
            self._settle(absent, were_there=False)

    def _settle(self, uuids: Collection[str], were_there: bool) -> None:
        """Answer what is open of robots, as far as it is known by now."""
        slots = np.array([self._slots[uuid] for uuid in uuids if uuid in self._slots], np.int64)
        self._outcomes.settle(slots, self._pairs, self._own_until_s, were_there=were_there)

    def _forget(self, uuids: Sequence[str]) -> None:
        slots = np.array([self._slots.pop(uuid) for uuid in uuids if uuid in self._slots], np.int64)
        if not len(slots):
            return
        self._spare.extend(slots.tolist())
        self._swept[:] = -1
        self._held[slots] = self._told[slots] = False
        self._robots["surprise"][slots] = self._absence[slots] = 0.0
        self._robots["stood_since_s"][slots] = np.inf
        self._words[slots] = unheard(len(slots))
        self._followed.forget(slots)
        self._rollouts.forget(slots)
        self._finder.forget(slots.tolist())
        self._heeded.forget(slots)
        a, b = slots_of(self._pairs["code"])
        self._pairs = self._pairs[self._held[a] & self._held[b]]
