"""The life of advisories: which predictions are worth a person's attention, and until when.

    nothing --(likely in M of N looks, or likely and urgent)--> raised
    raised, updated --(severity, probability, time, place or depth changed enough)--> updated
    raised, updated --(unlikely for a while and drawn apart; both stand; a robot left)--> cleared

Until then an advisory that is no longer predicted, or has begun, tells of its probability alone.

A look is a pass in which either robot had something new to say, so repeating an old forecast confirms nothing. An
encounter lasts until the pair has drawn apart by the clearance and a margin: what begins within the clearance does
not alert unless the envelopes are about to touch.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from operator import attrgetter
from typing import NamedTuple

from deconflict.advisories import conflict_wording
from deconflict.advisories.conflict_wording import (
    FADES_S,
    LIKELIER,
    SEVERITIES,
    SURE,
    UPDATE_GAP_S,
    Prediction,
    Predictions,
    Scene,
    Where,
    differs,
)
from deconflict.advisories.watched_pair_kernels import LIKELIHOOD, RAISES, STILL, UNLIKELY
from deconflict.advisories.watched_pairs import Stirred, Track, Tracks, Weighed, held_probability
from deconflict.advisory import AdvisoryState, ConflictAdvisory, Recommendation, Severity
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter
from ingest.batch import Pair

PASSED, STAND, UNPREDICTED = "they have passed each other", "both stand still", "no longer predicted"
GAVE_WAY = "one gave way to the other"
"""Why a conflict is cleared while both robots are on the floor."""
LEFT = "left the floor"


class Due(NamedTuple):
    """A prediction that is to be told if it is news, which hangs on how the two will meet."""

    track: Track
    prediction: Prediction
    severity: Severity


@dataclass(slots=True, eq=False)
class Lives:
    """Every pair under watch, and the advisories open between them."""

    settings: Conflict
    absent_after_s: float
    """A restored advisory whose robots are not heard of again within this time of the first step is cleared."""
    ordinals: dict[Pair, int] = field(default_factory=dict)
    """How many encounters each pair has had."""
    tracks: Tracks = field(init=False)
    told: dict[Pair, ConflictAdvisory] = field(default_factory=dict)
    """The newest revision of each open advisory."""
    _changed: set[Pair] = field(default_factory=set)
    started_s: float | None = None

    def __post_init__(self) -> None:
        self.tracks = Tracks(self.settings)

    def restore(self, open_advisories: Iterable[ConflictAdvisory]) -> None:
        """Go on with advisories that were open before a restart."""
        for advisory in open_advisories:
            self._adopt(self.tracks.get(advisory.robots) or self.tracks.new(advisory.robots), advisory)

    def adopt(self, told: ConflictAdvisory) -> None:
        """Take a revision that another engine decided for this pair's own, whatever was thought of it here."""
        track = self.tracks.get(told.robots)
        self.ordinals[told.robots] = max(told.encounter, self.ordinals.get(told.robots, 0))
        if told.state is not AdvisoryState.CLEARED:
            self._adopt(track or self.tracks.new(told.robots), told)
        elif track and track.advisory and track.advisory.id == told.id:
            self._tell(track, told)

    def _adopt(self, track: Track, told: ConflictAdvisory) -> None:
        self.tracks.predict(track, max(self.tracks.predicted_s(track), told.updated_at.timestamp()))
        self._tell(track, told, floor=-1)

    def changed(self) -> set[Pair]:
        """The pairs of which something was told since this was asked last."""
        changed, self._changed = self._changed, set()
        return changed

    def step(
        self,
        now_s: float,
        predictions: Predictions,
        updated: set[str],
        scene: Scene,
        until_s: float = inf,
    ) -> list[ConflictAdvisory]:
        """The revisions that this pass makes, ordered by pair.

        It looked no further than `until_s`: an open advisory on what comes later stands as it is.
        """
        self.started_s = now_s if self.started_s is None else self.started_s
        found, missed, resting = self.tracks.stirring(predictions, now_s, scene.encounters)
        revisions, due = [], []
        for one in found:
            said = self._stirred(one, now_s, scene)
            if isinstance(said, Due):
                due.append(said)
            else:
                revisions.append(self._kept(one.track, said))
        revisions += self._decided(due, now_s, scene)
        for track, rests in zip(missed, resting, strict=True):
            a, b = track.pair
            news = a in updated or b in updated
            left = track.advisory and not (scene.here(a) and scene.here(b))
            if _later(track.advisory, until_s):
                continue
            if news:
                self.tracks.missed(track)
            if left or not rests or (news and track.advisory is None):
                revisions.append(self._kept(track, self._unpredicted(track, now_s, scene)))
            if not left and self._may_fade(track, now_s):
                revisions.append(self._kept(track, self._as_likely(track, 0.0, now_s)))
        return sorted(filter(None, revisions), key=attrgetter("robots"))

    def silence(self, silent: set[str], now_s: float, scene: Scene) -> list[ConflictAdvisory]:
        """The revisions that tell of these robots that they have fallen silent, where that is not told yet."""
        revisions = []
        for pair, told in sorted(self.told.items()):
            if silent.isdisjoint(pair) or not all(map(scene.here, pair)):
                continue
            parties = scene.party(pair[0]), scene.party(pair[1])
            track = self.tracks.get(pair)
            if track and told.basis != (parties[0].basis, parties[1].basis):
                met = scene.meet(pair, told.predicted_at.timestamp())
                revision = conflict_wording.with_silence(told, parties, met, scene.places([met])[0], now_s)
                self._tell(track, revision)
                revisions.append(revision)
        return revisions

    def _kept(self, track: Track, revision: ConflictAdvisory | None) -> ConflictAdvisory | None:
        """Remember a pair, and its revision."""
        if revision:
            self._tell(track, revision)
        else:
            self.tracks.keep(track)
        return revision

    def advise(self, pair: Pair, advice: Recommendation, now_s: float) -> ConflictAdvisory | None:
        """The revision that gives a pair new advice; None where it has no advisory, or one that says the same.

        Where nobody has to wait any more, what was advised before stands until the advisory is cleared.
        """
        track = self.tracks.get(pair)
        before = track.advisory if track else None
        if track is None or before is None or not differs(before.recommendation, advice):
            return None
        if not advice.holds and not advice.note and before.recommendation:
            return None
        return self._kept(track, conflict_wording.with_advice(before, advice, now_s))

    def _tell(self, track: Track, revision: ConflictAdvisory, floor: int | None = None) -> None:
        """From now on this revision is the pair's newest, against which nothing was weighed yet; see `Tracks.tell`."""
        self.told.pop(track.pair, None)
        advisory = None if revision.state is AdvisoryState.CLEARED else revision
        self.tracks.tell(track, advisory, floor)
        if advisory:
            self.told[track.pair] = advisory
        self._changed.add(track.pair)
        self.tracks.keep(track)

    def _stirred(self, one: Stirred, now_s: float, scene: Scene) -> ConflictAdvisory | Due | None:
        """The revision that a prediction makes, or may make."""
        track, prediction, why = one
        if why == RAISES:
            return self._raised(track, prediction, now_s, scene)
        if why == UNLIKELY:
            return self._unpredicted(track, now_s, scene) or self._as_likely(track, prediction.probability, now_s)
        if why == LIKELIHOOD:
            return self._as_likely(track, prediction.probability, now_s)
        if why == STILL and track.advisory:
            both_stand = all(map(scene.stands, track.pair))
            return track.advisory.ended(now_s, STAND if both_stand else GAVE_WAY)
        return self._updated(track, prediction, now_s, scene)

    def _raised(self, track: Track, prediction: Prediction, now_s: float, scene: Scene) -> Due | None:
        self.ordinals[track.pair] = self.ordinals.get(track.pair, 0) + 1
        if not all(map(scene.here, track.pair)):
            return None
        return Due(track, prediction, conflict_wording.severity_of(prediction, now_s, None, self.settings))

    def _updated(
        self, track: Track, prediction: Prediction, now_s: float, scene: Scene
    ) -> ConflictAdvisory | Due | None:
        before = track.advisory
        if before is None:
            return None
        if before.time_to_conflict_s == 0 and prediction.contact_s <= now_s:
            return self._as_likely(track, prediction.probability, now_s)
        severity = conflict_wording.severity_of(prediction, now_s, before.severity, self.settings)
        rises = SEVERITIES.index(severity) > SEVERITIES.index(before.severity)
        next_s = _next_s(before)
        if not rises and now_s < next_s:
            self.tracks.weigh(track, self._weighed(prediction, now_s, next_s))
            return None
        return Due(track, prediction, severity) if all(map(scene.here, track.pair)) else None

    def _may_fade(self, track: Track, now_s: float) -> bool:
        """Whether an advisory may have to tell that its conflict, of which nothing was predicted for a while, has
        become unlikely."""
        told = track.advisory
        if told is None or (told.probability or 0.0) <= LIKELIER:
            return False
        return now_s - self.tracks.predicted_s(track) >= FADES_S

    def _as_likely(self, track: Track, probability: float, now_s: float) -> ConflictAdvisory | None:
        """The revision that tells nothing else than how likely its conflict is now, where that has changed."""
        told, likely = track.advisory, self._told_probability(probability)
        if told is None or now_s < _next_s(told) or not conflict_wording.is_likelier(told, likely):
            return None
        return conflict_wording.with_probability(told, likely, now_s)

    def _told_probability(self, probability: float) -> float:
        """What is not likely enough to stand is told to be half as likely as that, however little it is."""
        held = held_probability(self.settings)
        return probability if probability >= held else held / 2

    def _decided(self, due: Iterable[Due], now_s: float, scene: Scene) -> list[ConflictAdvisory]:
        """The revisions of those that are new, or say something else than was told."""
        news = []
        for one in due:
            track, prediction, severity = one
            met, before = scene.meet(track.pair, prediction.contact_s), track.advisory
            if before is None or conflict_wording.is_news(before, prediction, severity, met, scene.datum(met)):
                news.append((one, met))
            else:
                self.tracks.weigh(track, self._weighed(prediction, now_s))
                self.tracks.keep(track)
        places = scene.places([met for _, met in news])
        return [self._said(*one, place, now_s, scene) for one, place in zip(news, places, strict=True)]

    def _said(self, due: Due, met: Encounter, place: str, now_s: float, scene: Scene) -> ConflictAdvisory:
        """The revision of a pair that meets so, there."""
        (track, prediction, severity), pair = due, due.track.pair
        parties = scene.party(pair[0]), scene.party(pair[1])
        where = Where(scene.datum(met), place)
        prediction = prediction._replace(probability=self._told_probability(prediction.probability))
        told = conflict_wording.newest(prediction, now_s, where, parties, severity, met, self.settings.clearance_m)
        if track.advisory:
            revision = conflict_wording.updated(track.advisory, told)
        else:
            revision = conflict_wording.raised(pair, self.ordinals[pair], parties, told, now_s)
        self._tell(track, revision, met.floor)
        return revision

    def _weighed(self, one: Prediction, now_s: float, until_s: float = inf) -> Weighed:
        rises_s = conflict_wording.severity_until_s(one.contact_s, now_s, self.settings)
        return Weighed(one.contact_s, one.separation_m, one.probability >= SURE, min(rises_s, until_s))

    def _unpredicted(self, track: Track, now_s: float, scene: Scene) -> ConflictAdvisory | None:
        absent = [uuid for uuid in track.pair if not scene.here(uuid)]
        if absent:
            return self._absent(track, absent, now_s, scene)
        left = [uuid for uuid in track.pair if scene.absence(uuid)]
        apart_m = scene.separation_m(track.pair, now_s)
        if not left and apart_m is not None and apart_m <= self.settings.clearance_m + self.settings.clear_margin_m:
            return None
        self.tracks.part(track)
        advisory = track.advisory
        if advisory is None:
            return None
        if left:
            return advisory.ended(now_s, _why_absent(advisory, left, scene))
        return advisory.ended(now_s, PASSED if self.tracks.met(track) else UNPREDICTED)

    def _absent(self, track: Track, absent: list[str], now_s: float, scene: Scene) -> ConflictAdvisory | None:
        """A robot that left ends the advisory; one not yet heard of since a restart does so only in time."""
        self.tracks.part(track)
        self.tracks.overlook(track)
        advisory = track.advisory
        if advisory is None:
            return None
        restored = advisory.updated_at.timestamp() < (self.started_s or 0.0)
        if restored and now_s - (self.started_s or 0.0) < self.absent_after_s:
            return None
        return advisory.ended(now_s, _why_absent(advisory, absent, scene))


def _why_absent(advisory: ConflictAdvisory, absent: list[str], scene: Scene) -> str:
    """Which of its robots are not there, and why."""
    names = dict(zip(advisory.robots, advisory.names, strict=True))
    words = {names[uuid]: scene.absence(uuid) or LEFT for uuid in absent}
    if len(set(words.values())) == 1 and LEFT in words.values():
        return f"{' and '.join(words)} {LEFT}"
    return "; ".join(f"{name} {why}" for name, why in words.items())


def _next_s(told: ConflictAdvisory) -> float:
    """When the next revision may be told, unless the severity rises."""
    return told.updated_at.timestamp() + UPDATE_GAP_S


def _later(advisory: ConflictAdvisory | None, until_s: float) -> bool:
    return until_s < inf and advisory is not None and advisory.predicted_at.timestamp() > until_s
