"""The life of advisories: which predictions are worth a person's attention, and until when.

    nothing --(likely in M of N looks, or likely and urgent)--> raised
    raised, updated --(severity, probability, time, place or depth changed enough)--> updated
    raised, updated --(unlikely for a while and drawn apart; both stand; a robot left)--> cleared

A look is a pass in which either robot had something new to say, so repeating an old forecast confirms nothing. An
encounter lasts until the pair has drawn apart by the clearance and a margin: what begins within the clearance does
not alert unless the envelopes are about to touch.
"""

from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from operator import attrgetter
from typing import NamedTuple

from deconflict import telling
from deconflict.advice.desk import differs
from deconflict.advisory import AdvisoryState, ConflictAdvisory, Recommendation, Severity
from deconflict.site import Conflict
from deconflict.telling import SEVERITIES, SURE, Pair, Prediction, Scene

UPDATE_GAP_S = 1.0
"""At most one revision in this time, unless the severity rises."""
HELD_SHARE = 0.15
"""An advisory stands until its probability is below this share of the one that raises."""
TOUCHING_M = 0.1
"""A pair that begins nearer than this is touching already, for all that forecasts can tell."""

PASSED, STAND, UNPREDICTED = "they have passed each other", "both stand still", "no longer predicted"
"""Why a conflict is cleared while both robots are on the floor."""


class Weighed(NamedTuple):
    """A prediction that was not worth a revision yet."""

    contact_s: float
    separation_m: float
    sure: bool
    """Whether it was likely enough for its severity."""
    advisory: ConflictAdvisory
    """The revision that it was held against."""
    until_s: float
    """When time alone may make it worth one."""


@dataclass(slots=True, eq=False)
class Track:
    """One pair under watch."""

    looks: deque[bool]
    inside: bool = False
    """Within the clearance, or not yet drawn apart from it."""
    met: bool = False
    """Came within the clearance while the advisory stood."""
    weighed: Weighed | None = None
    """The newest that was, if nothing new has been said since."""
    last_predicted_s: float = 0.0
    advisory: ConflictAdvisory | None = None

    def look(self, *, alerting: bool) -> None:
        """Either robot had something new to say."""
        self.looks.append(alerting)
        self.weighed = None


@dataclass(slots=True, eq=False)
class Lives:
    """Every pair under watch, and the advisories open between them."""

    settings: Conflict
    absent_after_s: float
    """A restored advisory whose robots are not heard of again within this time of the first step is cleared."""
    ordinals: dict[Pair, int] = field(default_factory=dict)
    """How many encounters each pair has had."""
    tracks: dict[Pair, Track] = field(default_factory=dict)
    told: dict[Pair, ConflictAdvisory] = field(default_factory=dict)
    """The newest revision of each open advisory."""
    severities: Counter[Severity] = field(default_factory=Counter)
    """How many of them there are of each."""
    _changed: set[Pair] = field(default_factory=set)
    started_s: float | None = None

    def restore(self, open_advisories: Iterable[ConflictAdvisory]) -> None:
        """Go on with advisories that were open before a restart."""
        for advisory in open_advisories:
            track = self.tracks[advisory.robots] = self._new_track()
            track.last_predicted_s = advisory.updated_at.timestamp()
            self._tell(track, advisory)

    def adopt(self, told: ConflictAdvisory) -> None:
        """Take a revision that another engine decided for this pair's own, whatever was thought of it here."""
        track = self.tracks.get(told.robots)
        self.ordinals[told.robots] = max(told.encounter, self.ordinals.get(told.robots, 0))
        if told.state is not AdvisoryState.CLEARED:
            if track is None:
                self.restore([told])
            else:
                track.last_predicted_s = max(track.last_predicted_s, told.updated_at.timestamp())
                self._tell(track, told)
        elif track and track.advisory and track.advisory.id == told.id:
            self._tell(track, told)

    def changed(self) -> set[Pair]:
        """The pairs of which something was told since this was asked last."""
        changed, self._changed = self._changed, set()
        return changed

    def step(
        self,
        now_s: float,
        predictions: Iterable[Prediction],
        updated: set[str],
        scene: Scene,
        until_s: float = inf,
    ) -> list[ConflictAdvisory]:
        """The revisions that this pass makes, ordered by pair.

        It looked no further than `until_s`: an open advisory on what comes later stands as it is.
        """
        self.started_s = now_s if self.started_s is None else self.started_s
        missed, revisions = dict(self.tracks), []
        for one in predictions:
            track = missed.pop(one.pair, None)
            if track is None:
                if not (one.fresh and self._matters(one, now_s)):
                    continue
                track = self.tracks[one.pair] = self._new_track()
            elif self._rests(track, one, now_s):
                track.last_predicted_s = now_s
                continue
            revisions.append(self._kept(track, one.pair, self._advance(track, one, now_s, scene)))
        for pair, track in missed.items():
            if not _later(track.advisory, until_s):
                news = not updated.isdisjoint(pair)
                revisions.append(self._kept(track, pair, self._missed(track, pair, now_s, scene, news)))
        return sorted(filter(None, revisions), key=attrgetter("robots"))

    def _kept(self, track: Track, pair: Pair, revision: ConflictAdvisory | None) -> ConflictAdvisory | None:
        """Remember a pair's revision, and forget the pair where there is nothing left to remember."""
        if revision:
            self._tell(track, revision)
        if track.advisory is None and not track.inside and not any(track.looks):
            del self.tracks[pair]
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
        return self._tell(track, telling.with_advice(before, advice, now_s))

    def _tell(self, track: Track, revision: ConflictAdvisory) -> ConflictAdvisory:
        """From now on this revision is the pair's newest."""
        pair, before = revision.robots, self.told.pop(revision.robots, None)
        if before:
            self.severities[before.severity] -= 1
        track.advisory = None if revision.state is AdvisoryState.CLEARED else revision
        if track.advisory:
            self.severities[revision.severity] += 1
            self.told[pair] = revision
        self._changed.add(pair)
        return revision

    def _new_track(self) -> Track:
        return Track(deque(maxlen=self.settings.confirm[1]))

    def _missed(self, track: Track, pair: Pair, now_s: float, scene: Scene, news: bool) -> ConflictAdvisory | None:
        """The revision of a pair of which nothing is predicted."""
        if news:
            track.look(alerting=False)
        return self._unpredicted(track, pair, now_s, scene) if news or track.advisory else None

    def _rests(self, track: Track, prediction: Prediction, now_s: float) -> bool:
        """Whether a pair draws near as it did when it was last weighed, so that nothing is to be done."""
        apart = not track.inside and prediction.start_separation_m > self.settings.clearance_m
        return apart and self._is_weighed(track, prediction, now_s) and self._holds(prediction)

    def _is_weighed(self, track: Track, prediction: Prediction, now_s: float) -> bool:
        """Whether a prediction without news is, for all that a person would do about it, what was weighed before."""
        weighed = track.weighed
        return (
            not prediction.fresh
            and weighed is not None
            and weighed.advisory is track.advisory
            and now_s < weighed.until_s
            and prediction.contact_s == weighed.contact_s
            and prediction.separation_m == weighed.separation_m
            and (prediction.probability >= SURE) == weighed.sure
            and not telling.is_likelier(weighed.advisory, prediction)
        )

    def _advance(self, track: Track, prediction: Prediction, now_s: float, scene: Scene) -> ConflictAdvisory | None:
        """The revision that a prediction makes."""
        self._note_start(track, prediction.start_separation_m)
        alerting = prediction.fresh and self._alerting(track, prediction, now_s)
        if prediction.fresh:
            track.look(alerting=alerting)
        if track.advisory and not track.inside and not self._holds(prediction):
            return self._unpredicted(track, prediction.pair, now_s, scene)
        if track.advisory:
            track.last_predicted_s = now_s
            standing = self._standing(track, track.advisory, now_s, scene)
            return standing or self._updated(track, track.advisory, prediction, now_s, scene)
        if alerting and self._confirmed(track, prediction, now_s):
            track.last_predicted_s, track.met = now_s, False
            return self._raised(prediction, now_s, scene)
        return None

    def _note_start(self, track: Track, start_m: float) -> None:
        """Note whether the pair, so far apart now, is within the clearance, or has drawn apart from it."""
        if start_m <= self.settings.clearance_m:
            track.inside = track.met = True
        elif start_m > self.settings.clearance_m + self.settings.clear_margin_m:
            track.inside = False

    def _alerting(self, track: Track, prediction: Prediction, now_s: float) -> bool:
        """Whether the pair is coming together, rather than beginning together."""
        about_to_touch = prediction.separation_m == 0 and prediction.start_separation_m > TOUCHING_M
        return about_to_touch if track.inside else self._likely(prediction, now_s)

    def _likely(self, prediction: Prediction, now_s: float) -> bool:
        """Whether an encounter is yet to come that is worth an advisory."""
        wanted = self.settings.raise_probability
        if prediction.separation_m > self.settings.clearance_m:
            wanted = max(wanted, SURE)
        return prediction.probability >= wanted and prediction.contact_s > now_s

    def _matters(self, prediction: Prediction, now_s: float) -> bool:
        """Whether there is anything to remember of news of a pair that was not under watch."""
        return prediction.start_separation_m <= self.settings.clearance_m or self._likely(prediction, now_s)

    def _holds(self, prediction: Prediction) -> bool:
        return prediction.probability >= self.settings.raise_probability * HELD_SHARE

    def _confirmed(self, track: Track, prediction: Prediction, now_s: float) -> bool:
        wanted = self.settings.confirm[0]
        return sum(track.looks) >= wanted or prediction.contact_s - now_s <= self.settings.urgent_s

    def _raised(self, prediction: Prediction, now_s: float, scene: Scene) -> ConflictAdvisory | None:
        pair = prediction.pair
        ordinal = self.ordinals[pair] = self.ordinals.get(pair, 0) + 1
        if not all(map(scene.here, pair)):
            return None
        severity = telling.severity_of(prediction, now_s, None, self.settings)
        met = scene.meet(pair, prediction.contact_s)
        parties = scene.party(pair[0]), scene.party(pair[1])
        told = telling.newest(prediction, now_s, scene, parties, severity, met, self.settings.clearance_m)
        return telling.raised(pair, ordinal, parties, told, now_s)

    def _updated(
        self, track: Track, before: ConflictAdvisory, prediction: Prediction, now_s: float, scene: Scene
    ) -> ConflictAdvisory | None:
        if before.time_to_conflict_s == 0 and prediction.contact_s <= now_s:
            return None
        if self._is_weighed(track, prediction, now_s):
            return None
        severity = telling.severity_of(prediction, now_s, before.severity, self.settings)
        rises = SEVERITIES.index(severity) > SEVERITIES.index(before.severity)
        next_s = before.updated_at.timestamp() + UPDATE_GAP_S
        if not rises and now_s < next_s:
            track.weighed = self._weighed(prediction, before, now_s, next_s)
            return None
        pair = prediction.pair
        if not all(map(scene.here, pair)):
            return None
        met = scene.meet(pair, prediction.contact_s)
        if not telling.is_news(before, prediction, severity, met, scene.datum(met)):
            track.weighed = self._weighed(prediction, before, now_s)
            return None
        parties = scene.party(pair[0]), scene.party(pair[1])
        told = telling.newest(prediction, now_s, scene, parties, severity, met, self.settings.clearance_m)
        return telling.updated(before, told)

    def _weighed(self, one: Prediction, before: ConflictAdvisory, now_s: float, until_s: float = inf) -> Weighed:
        rises_s = telling.severity_until_s(one.contact_s, now_s, self.settings)
        return Weighed(one.contact_s, one.separation_m, one.probability >= SURE, before, min(rises_s, until_s))

    def _standing(
        self, track: Track, advisory: ConflictAdvisory, now_s: float, scene: Scene
    ) -> ConflictAdvisory | None:
        """Clear a pair that met and now both stand: nothing more is predicted of it."""
        if not track.inside or not all(map(scene.stands, advisory.robots)):
            return None
        since_s = now_s - advisory.updated_at.timestamp()
        return advisory.ended(now_s, STAND) if since_s > self.settings.clear_after_s else None

    def _unpredicted(self, track: Track, pair: Pair, now_s: float, scene: Scene) -> ConflictAdvisory | None:
        absent = [uuid for uuid in pair if not scene.here(uuid)]
        if absent:
            return self._absent(track, pair, absent, now_s)
        if track.advisory and now_s - track.last_predicted_s < self.settings.clear_after_s:
            return None
        apart_m = scene.separation_m(pair, now_s)
        if apart_m is not None and apart_m <= self.settings.clearance_m + self.settings.clear_margin_m:
            return None
        track.inside = False
        advisory = track.advisory
        if advisory is None:
            return None
        return advisory.ended(now_s, PASSED if track.met else UNPREDICTED)

    def _absent(self, track: Track, pair: Pair, absent: list[str], now_s: float) -> ConflictAdvisory | None:
        """A robot that left ends the advisory; one not yet heard of since a restart does so only in time."""
        track.inside = False
        track.looks.clear()
        advisory = track.advisory
        if advisory is None:
            return None
        restored = advisory.updated_at.timestamp() < (self.started_s or 0.0)
        if restored and now_s - (self.started_s or 0.0) < self.absent_after_s:
            return None
        names = dict(zip(pair, advisory.names, strict=True))
        return advisory.ended(now_s, f"{' and '.join(names[uuid] for uuid in absent)} left the floor")


def _later(advisory: ConflictAdvisory | None, until_s: float) -> bool:
    return until_s < inf and advisory is not None and advisory.predicted_at.timestamp() > until_s
