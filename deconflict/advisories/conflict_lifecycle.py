"""The life of a conflict advisory: which predictions are worth a person's attention, and until when.

    no advisory --(alerting in M of N looks, or alerting and urgent or evident)--> raised
    raised, updated --(severity, probability, time, place or depth changed enough)--> updated
    raised, updated --(a robot fell silent; new advice)--> updated
    raised, updated --(unlikely for a while and drawn apart; over unseen; both still; a robot left)--> cleared

A look is a pass in which either robot has a new forecast, so a repeated forecast confirms nothing. An encounter lasts
until the pair has drawn apart by the clearance and a margin: a pair that begins within the clearance alerts only if
the envelopes are about to touch. An advisory whose conflict is not predicted any more, or has begun, is updated in its
probability alone, and in its severity by it.

These files take part, in this order:

1. `watched_pair_kernels`, through `watched_pairs`, decides for all pairs at once, with the limits of `revision_rules`
   and the levels of `severity`.
2. This file makes a revision of each decision. It decides only what depends on the scene: whether robots are there,
   whether a pair has drawn apart, and whether it meets elsewhere than its advisory says.
3. `words.conflict_wording` fills the fields and writes the text.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from math import inf
from operator import attrgetter

from deconflict.advice.document_limits import limited_advice
from deconflict.advisories import revision_rules
from deconflict.advisories.encounter_numbers import EncounterNumbers
from deconflict.advisories.live_scene import LiveScene
from deconflict.advisories.revision_budget import Candidate, RevisionBudget
from deconflict.advisories.severity import severity_of
from deconflict.advisories.watched.unseen_ends import UnseenEnds, cleared_as_apart
from deconflict.advisories.watched.watched_pair_kernels import (
    CLEAR_STILL,
    MAY_CLEAR,
    NO_CHANGE,
    UPDATE_IF_MOVED,
    UPDATE_PROBABILITY,
)
from deconflict.advisories.watched.watched_pairs import Examination, FoundPrediction, WatchedPair, WatchedPairs
from deconflict.advisories.words import conflict_wording
from deconflict.advisories.words.words import Spot
from deconflict.foresight.conflict_predictions import Predictions
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter
from deconflict_client.advisory import AdvisoryState, ClearedCode, ConflictAdvisory, Recommendation
from ingest.batch import Pair


@dataclass(slots=True, eq=False)
class ConflictLifecycle:
    """Every watched pair, and the open conflict advisories."""

    settings: Conflict
    absent_after_s: float
    """A restored advisory is cleared if its robots are not heard of within this time of the first pass."""
    ordinals: EncounterNumbers = field(default_factory=lambda: EncounterNumbers({}))
    pairs: WatchedPairs = field(init=False)
    _unseen: UnseenEnds = field(init=False)
    advisories: dict[Pair, ConflictAdvisory] = field(default_factory=dict)
    """The newest revision of each open advisory."""
    _changed: set[Pair] = field(default_factory=set)
    """The pairs with a new revision since the last `take_changed`."""
    budget: RevisionBudget = field(default_factory=RevisionBudget)
    started_s: float | None = None
    """When the first pass was; None before."""

    def __post_init__(self) -> None:
        self.pairs = WatchedPairs(self.settings)
        self._unseen = UnseenEnds(self.pairs, self.settings)

    def take_changed(self) -> set[Pair]:
        """The pairs with a new revision since the last call; those that ended are in `advisories` no more."""
        changed, self._changed = self._changed, set()
        return changed

    def restore(self, open_advisories: Iterable[ConflictAdvisory]) -> None:
        """Continue advisories that were open before a restart."""
        for advisory in open_advisories:
            self._adopt_open(self.pairs.get(advisory.robots) or self.pairs.add(advisory.robots), advisory)

    def resume(self, published: Mapping[Pair, ConflictAdvisory], ordinals: Mapping[Pair, int]) -> None:
        """Have these advisories open, and no others."""
        self.ordinals.take(ordinals)
        for pair in self.advisories.keys() | published.keys():
            watched, is_known = self.pairs.get(pair) or self.pairs.add(pair), pair in self.advisories
            self.pairs.set_advisory(watched, published.get(pair), None if is_known else -1)
        self.advisories = dict(published)

    def adopt(self, revision: ConflictAdvisory) -> None:
        """Continue from a revision that another engine made, whatever was decided here for its pair."""
        pair = revision.robots
        watched = self.pairs.get(pair)
        self.ordinals.note(pair, revision.encounter)
        if revision.state is not AdvisoryState.CLEARED:
            self._adopt_open(watched or self.pairs.add(pair), revision)
        elif watched and watched.advisory and watched.advisory.id == revision.id:
            self._set_newest(watched, revision)

    def _adopt_open(self, watched: WatchedPair, revision: ConflictAdvisory) -> None:
        predicted_s = max(self.pairs.predicted_s(watched), revision.updated_at.timestamp())
        self.pairs.set_predicted_s(watched, predicted_s)
        self._set_newest(watched, revision, floor=-1)

    def revise(
        self,
        now_s: float,
        predictions: Predictions,
        updated: set[str],
        scene: LiveScene,
        until_s: float = inf,
        returned: Set[str] = frozenset(),
    ) -> list[ConflictAdvisory]:
        """The revisions of one pass, ordered by pair.

        `updated` are the robots with a new forecast, and those that have left, `returned` those that were not heard for
        a while before. The pass looked no further than `until_s`: an open advisory on a later conflict stands as it is.
        """
        self.started_s = now_s if self.started_s is None else self.started_s
        revisions = [self._settled(*each) for each in self._unseen.ends(returned, predictions, now_s, scene)]
        examination, candidates = self.pairs.examine(predictions, updated, now_s, scene.encounters), []
        for found in examination.found:
            outcome = self._revise_predicted(found, now_s, scene)
            if isinstance(outcome, Candidate):
                candidates.append(outcome)
            else:
                revisions.append(self._settled(found.watched, outcome))
        revisions += self._revise_candidates(candidates, now_s, scene)
        revisions += self._revise_unpredicted(examination, updated, now_s, scene, until_s)
        return sorted(filter(None, revisions), key=attrgetter("robots"))

    def mark_silent(self, silent: set[str], now_s: float, scene: LiveScene) -> list[ConflictAdvisory]:
        """The revisions that say that these robots have fallen silent; none if their advisories say so already."""
        if not silent:
            return []
        revisions = []
        concerned = [(pair, advisory) for pair, advisory in self.advisories.items() if not silent.isdisjoint(pair)]
        for pair, advisory in sorted(concerned):
            if not all(map(scene.is_present, pair)):
                continue
            parties = scene.party(pair[0], now_s), scene.party(pair[1], now_s)
            watched = self.pairs.get(pair)
            if watched and advisory.basis != (parties[0].basis, parties[1].basis):
                met = scene.encounter(pair, advisory.predicted_at.timestamp())
                (spot,) = scene.spots([met])
                revision = conflict_wording.with_silence(advisory, parties, met, spot, now_s)
                self._set_newest(watched, revision)
                revisions.append(revision)
        return revisions

    def dismiss(
        self, changed: Iterable[str], robots: Container[str], reason: ClearedCode, now_s: float
    ) -> list[ConflictAdvisory]:
        """Watch no pairs of two of `robots` any more, of which at least one is in `changed`: no conflicts are looked
        for among them. The revisions that clear their advisories."""
        revisions = []
        for watched in self.pairs.among(robots, set(changed)):
            self.pairs.mark_apart(watched)
            self.pairs.forget_looks(watched)
            revision = watched.advisory.cleared_revision(now_s, reason) if watched.advisory else None
            revisions.append(self._settled(watched, revision))
        return sorted(filter(None, revisions), key=attrgetter("robots"))

    def add_advice(self, pair: Pair, advice: Recommendation, now_s: float) -> ConflictAdvisory | None:
        """The revision that gives a pair new advice; None if it has no advisory, or one with the same advice.

        If nobody has to wait any more, the advice from before stands until the advisory is cleared.
        """
        watched, advice = self.pairs.get(pair), limited_advice(advice, pair)
        before = watched.advisory if watched else None
        if watched is None or before is None or not revision_rules.advice_differs(before.recommendation, advice):
            return None
        if not advice.holds and not advice.note and before.recommendation:
            return None
        return self._settled(watched, conflict_wording.with_advice(before, advice, now_s))

    def _settled(self, watched: WatchedPair, revision: ConflictAdvisory | None) -> ConflictAdvisory | None:
        """Store a pair's revision, if there is one; forget the pair if nothing is left to remember."""
        if revision:
            self._set_newest(watched, revision)
        else:
            self.pairs.forget_if_idle(watched)
        return revision

    def _set_newest(self, watched: WatchedPair, revision: ConflictAdvisory, floor: int | None = None) -> None:
        """Make this the newest revision of a pair; for `floor` see `WatchedPairs.set_advisory`."""
        self._changed.add(watched.pair)
        self.advisories.pop(watched.pair, None)
        advisory = None if revision.state is AdvisoryState.CLEARED else revision
        self.pairs.set_advisory(watched, advisory, floor)
        if advisory:
            self.advisories[watched.pair] = advisory
        self.pairs.forget_if_idle(watched)

    def _revise_predicted(
        self, found: FoundPrediction, now_s: float, scene: LiveScene
    ) -> ConflictAdvisory | Candidate | None:
        """The revision that a prediction makes, or may make, by the code of the kernel."""
        watched, prediction, code = found
        if code == MAY_CLEAR:
            cleared = self._clear_if_apart(watched, now_s, scene)
            return cleared or self._update_probability(watched, prediction.probability, now_s)
        if code == UPDATE_PROBABILITY:
            return self._update_probability(watched, prediction.probability, now_s)
        if code == CLEAR_STILL and watched.advisory:
            both_stand = all(map(scene.stands, watched.pair))
            return watched.advisory.cleared_revision(
                now_s, ClearedCode.BOTH_STAND if both_stand else ClearedCode.GAVE_WAY
            )
        if not all(map(scene.is_present, watched.pair)):
            return None
        before = watched.advisory.severity if watched.advisory else None
        severity = severity_of(
            prediction.contact_s - now_s, prediction.separation_m, prediction.probability, before, self.settings
        )
        return Candidate(watched, prediction, severity, is_news=code != UPDATE_IF_MOVED)

    def _update_probability(self, watched: WatchedPair, probability: float, now_s: float) -> ConflictAdvisory | None:
        """The revision that changes the probability, and the severity by it; None if the change is too small or too
        soon."""
        before = watched.advisory
        if before is None:
            return None
        time_s = before.predicted_at.timestamp() - now_s
        severity = severity_of(time_s, before.min_separation_m, probability, before.severity, self.settings)
        probability = self._published_probability(probability)
        is_too_soon = now_s < before.updated_at.timestamp() + revision_rules.UPDATE_GAP_S
        is_as_likely = not revision_rules.is_likelier(probability, before.probability or 0.0)
        if severity is before.severity and (is_too_soon or is_as_likely):
            return None
        return conflict_wording.with_probability(before, probability, severity, now_s)

    def _published_probability(self, probability: float) -> float:
        return revision_rules.published_probability(probability, revision_rules.held_probability(self.settings))

    def _revise_candidates(
        self, candidates: Sequence[Candidate], now_s: float, scene: LiveScene
    ) -> list[ConflictAdvisory]:
        """The revisions of those candidates that are new or differ enough from their advisories, within the budget."""
        news, budget = [], self.budget
        budget.begin_pass(now_s, scene.account)
        is_bounded = budget.may_exceed(len(candidates))
        for candidate in sorted(candidates, key=attrgetter("urgency")) if is_bounded else candidates:
            watched = candidate.watched
            if is_bounded and not budget.admits(watched.pair):
                continue
            met, before = scene.encounter(watched.pair, candidate.prediction.contact_s), watched.advisory
            if candidate.is_news or (before and revision_rules.is_elsewhere(before, met, scene.datum(met))):
                news.append((candidate, met))
                budget.spend(watched.pair)
        spots = scene.spots([met for _, met in news])
        return [
            self._revision(candidate, met, spot, now_s, scene)
            for (candidate, met), spot in zip(news, spots, strict=True)
        ]

    def _revision(
        self, candidate: Candidate, met: Encounter, spot: Spot, now_s: float, scene: LiveScene
    ) -> ConflictAdvisory:
        """The revision of a pair that meets like `met`, there."""
        watched, prediction, severity, _ = candidate
        pair = watched.pair
        parties = scene.party(pair[0], now_s), scene.party(pair[1], now_s)
        probability = self._published_probability(prediction.probability)
        fields = conflict_wording.revision_fields(
            prediction._replace(probability=probability),
            now_s,
            scene.datum(met),
            spot,
            parties,
            severity,
            met,
            self.settings.clearance_m,
        )
        if watched.advisory:
            revision = conflict_wording.updated(watched.advisory, fields)
        else:
            revision = conflict_wording.raised(pair, self.ordinals.next(pair), parties, fields, now_s)
        self._set_newest(watched, revision, met.floor)
        return revision

    def _revise_unpredicted(
        self, examination: Examination, updated: set[str], now_s: float, scene: LiveScene, until_s: float
    ) -> Iterator[ConflictAdvisory | None]:
        """The revisions of pairs without a prediction: they clear, or fall to a low probability. A pair without an
        advisory is forgotten if a robot of it has left."""
        for watched, code in examination.unpredicted:
            a, b = watched.pair
            is_look = a in updated or b in updated
            is_absent = watched.advisory and (scene.absence(a) or scene.absence(b))
            is_unchanged = watched.advisory and code == NO_CHANGE and not is_look and not is_absent
            if is_unchanged or _is_later(watched.advisory, until_s):
                continue
            if is_look:
                self.pairs.record_quiet_look(watched)
            revision = None
            if is_absent or code == MAY_CLEAR or (is_look and watched.advisory is None):
                revision = self._clear_if_apart(watched, now_s, scene)
            is_awaited = is_absent and self._is_awaited(watched.advisory, now_s)
            if revision is None and not is_awaited and code in (MAY_CLEAR, UPDATE_PROBABILITY):
                revision = self._update_probability(watched, 0.0, now_s)
            yield self._settled(watched, revision)

    def _clear_if_apart(self, watched: WatchedPair, now_s: float, scene: LiveScene) -> ConflictAdvisory | None:
        """The revision that clears an advisory, if the two have drawn apart or a robot is not there."""
        absent = [uuid for uuid in watched.pair if not scene.is_present(uuid)]
        if absent:
            return self._clear_if_absent(watched, absent, now_s, scene)
        left = [uuid for uuid in watched.pair if scene.absence(uuid)]
        apart_m = scene.separation_m(watched.pair, now_s)
        if not left and apart_m is not None and apart_m <= self.settings.apart_m:
            return None
        self.pairs.mark_apart(watched)
        advisory = watched.advisory
        if advisory is None:
            return None
        if left:
            return advisory.cleared_revision(now_s, *_why_absent(advisory, left, scene))
        return cleared_as_apart(self.pairs, watched, advisory, now_s)

    def _is_awaited(self, advisory: ConflictAdvisory | None, now_s: float) -> bool:
        """Whether a restored advisory stands as it is until its robots are heard of."""
        begins_s = advisory.predicted_at.timestamp() if advisory else now_s
        return now_s - max(begins_s, self.started_s or 0.0) < self.settings.clear_after_s

    def _clear_if_absent(
        self, watched: WatchedPair, absent: list[str], now_s: float, scene: LiveScene
    ) -> ConflictAdvisory | None:
        """The revision that clears an advisory whose robots left; None while a restored one still waits for them."""
        self.pairs.mark_apart(watched)
        self.pairs.forget_looks(watched)
        advisory = watched.advisory
        if advisory is None:
            return None
        started_s = self.started_s or 0.0
        is_restored = self.pairs.predicted_s(watched) < started_s
        if is_restored and now_s - started_s < self.absent_after_s:
            return None
        return advisory.cleared_revision(now_s, *_why_absent(advisory, absent, scene))


def _why_absent(advisory: ConflictAdvisory, absent: list[str], scene: LiveScene) -> tuple[ClearedCode, str]:
    return conflict_wording.cleared_as_absent(advisory, {uuid: scene.absence(uuid) for uuid in absent})


def _is_later(advisory: ConflictAdvisory | None, until_s: float) -> bool:
    """Whether an advisory is on a conflict after `until_s`."""
    return until_s < inf and advisory is not None and advisory.predicted_at.timestamp() > until_s
