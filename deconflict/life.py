"""The life of advisories: which predictions are worth a person's attention, and until when.

    nothing --(likely in M of N looks, or likely and urgent)--> raised
    raised, updated --(severity, probability, time, place or depth changed enough)--> updated
    raised, updated --(unlikely for a while and drawn apart; both stand; a robot left)--> cleared

A look is a pass in which either robot had something new to say, so repeating an old forecast confirms nothing. An
encounter lasts until the pair has drawn apart by the clearance and a margin: what begins within the clearance does
not alert unless the envelopes are about to touch.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from math import hypot, inf
from typing import NamedTuple
from uuid import UUID, uuid5

from deconflict.advice.desk import advised, differs
from deconflict.advisory import AdvisoryState, ConflictAdvisory, EncounterClass, Location, Recommendation, Severity
from deconflict.encounter import Encounter
from deconflict.site import Conflict

Pair = tuple[str, str]

ADVISORIES = UUID("5f3d2f5e-6d0b-5a53-9f0a-3f0f3a0a7c11")
"""Namespace of advisory ids."""
UPDATE_GAP_S = 1.0
"""At most one revision in this time, unless the severity rises."""
MOVED_S, MOVED_M, DEEPER_M = 0.75, 1.0, 0.15
"""Changes of predicted time, place and separation that are worth a revision."""
LIKELIER = 0.15
"""A change of probability that is worth a revision."""
HELD_SHARE = 0.3
"""An advisory stands until its probability is below this share of the one that raises."""
SURE = 0.8
"""A conflict less likely than this is one level less severe, and none where the forecasts as they stand miss."""
TOUCHING_M = 0.1
"""A pair that begins nearer than this is touching already, for all that forecasts can tell."""

PASSED, STAND, UNPREDICTED = "they have passed each other", "both stand still", "no longer predicted"
"""Why a conflict is cleared while both robots are on the floor."""

SEVERITIES = (Severity.CAUTION, Severity.WARNING, Severity.CRITICAL)


class Prediction(NamedTuple):
    """One pair that comes within the clearance by the forecasts as they stand, or is likely to."""

    pair: Pair
    contact_s: float
    separation_m: float
    start_separation_m: float
    fresh: bool
    """Whether either robot's forecast is new in this pass."""
    probability: float = 1.0
    """That their envelopes come within the clearance in the horizon."""


@dataclass(frozen=True, slots=True)
class Party:
    """What an advisory says of one robot."""

    name: str
    vendor: str
    basis: str
    standing: bool


@dataclass(frozen=True, slots=True)
class Scene:
    """What the life of advisories asks of the engine's state."""

    here: Callable[[str], bool]
    """Whether a robot is on the floor."""
    party: Callable[[str], Party | None]
    """None for a robot that is not."""
    meet: Callable[[Pair, float], Encounter]
    separation_m: Callable[[Pair, float], float | None]
    """None where the two cannot be compared."""
    datum: Callable[[Encounter], str]
    """The datum's id."""
    place: Callable[[Encounter], str]
    """Where on it, in words."""


@dataclass(frozen=True)
class Telling:
    """The fields of an advisory that follow from its newest prediction."""

    severity: Severity
    encounter_class: EncounterClass
    basis: tuple[str, str]
    updated_at: datetime
    predicted_at: datetime
    time_to_conflict_s: float
    probability: float
    clearance_m: float
    min_separation_m: float
    closing_speed_mps: float
    location: Location
    summary: str


@dataclass(slots=True, eq=False)
class Track:
    """One pair under watch."""

    looks: deque[bool]
    inside: bool = False
    """Within the clearance, or not yet drawn apart from it."""
    met: bool = False
    """Came within the clearance while the advisory stood."""
    weighed: tuple[object, ...] = ()
    """The newest prediction that was not worth a revision, and of what revision that was thought."""
    last_predicted_s: float = 0.0
    advisory: ConflictAdvisory | None = None


@dataclass(slots=True, eq=False)
class Lives:
    """Every pair under watch, and the advisories open between them."""

    settings: Conflict
    absent_after_s: float
    """A restored advisory whose robots are not heard of again within this time of the first step is cleared."""
    ordinals: dict[Pair, int] = field(default_factory=dict)
    """How many encounters each pair has had."""
    tracks: dict[Pair, Track] = field(default_factory=dict)
    started_s: float | None = None

    def restore(self, open_advisories: Iterable[ConflictAdvisory]) -> None:
        """Go on with advisories that were open before a restart."""
        for advisory in open_advisories:
            track = self._new_track()
            track.advisory, track.inside = advisory, False
            track.last_predicted_s = advisory.updated_at.timestamp()
            self.tracks[advisory.robots] = track

    def adopt(self, told: ConflictAdvisory) -> None:
        """Take a revision that another engine decided for this pair's own, whatever was thought of it here."""
        track = self.tracks.get(told.robots)
        self.ordinals[told.robots] = max(told.encounter, self.ordinals.get(told.robots, 0))
        if told.state is not AdvisoryState.CLEARED:
            if track is None:
                self.restore([told])
            else:
                track.advisory, track.last_predicted_s = told, max(track.last_predicted_s, told.updated_at.timestamp())
        elif track and track.advisory and track.advisory.id == told.id:
            track.advisory = None

    def open(self) -> list[ConflictAdvisory]:
        return [track.advisory for track in self.tracks.values() if track.advisory]

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
        revisions = []
        predicted = {one.pair: one for one in predictions}
        for pair in sorted(predicted.keys() | self.tracks.keys()):
            track = self.tracks.get(pair)
            if track and pair not in predicted and _later(track.advisory, until_s):
                continue
            if track is None:
                if not predicted[pair].fresh:
                    continue
                track = self.tracks[pair] = self._new_track()
            revision = self._advance(track, pair, predicted.get(pair), now_s, updated, scene)
            if revision:
                track.advisory = None if revision.state is AdvisoryState.CLEARED else revision
                revisions.append(revision)
            if track.advisory is None and not track.inside and not any(track.looks):
                del self.tracks[pair]
        return revisions

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
        bare = before.summary.split(";")[0]
        track.advisory = before.model_copy(
            update={
                "revision": before.revision + 1,
                "seq": 0,
                "state": AdvisoryState.UPDATED,
                "updated_at": _moment(now_s),
                "time_to_conflict_s": round(max(before.predicted_at.timestamp() - now_s, 0.0), 3),
                "recommendation": advice,
                "summary": advised(bare, advice, before.robots, before.names),
            }
        )
        return track.advisory

    def _new_track(self) -> Track:
        return Track(deque(maxlen=self.settings.confirm[1]))

    def _advance(
        self,
        track: Track,
        pair: Pair,
        prediction: Prediction | None,
        now_s: float,
        updated: set[str],
        scene: Scene,
    ) -> ConflictAdvisory | None:
        if prediction is None:
            news = not updated.isdisjoint(pair)
            if news:
                track.looks.append(False)
            return self._unpredicted(track, pair, now_s, scene) if news or track.advisory else None
        alerting = self._alerting(track, prediction, now_s)
        if prediction.fresh:
            track.looks.append(alerting)
        if track.advisory and not track.inside and not self._holds(prediction):
            return self._unpredicted(track, pair, now_s, scene)
        if track.advisory:
            track.last_predicted_s = now_s
            standing = self._standing(track, track.advisory, now_s, scene)
            return standing or self._updated(track, track.advisory, prediction, now_s, scene)
        if alerting and prediction.fresh and self._confirmed(track, prediction, now_s):
            track.last_predicted_s, track.met = now_s, False
            return self._raised(prediction, now_s, scene)
        return None

    def _alerting(self, track: Track, prediction: Prediction, now_s: float) -> bool:
        """Whether the pair is coming together, rather than beginning together."""
        clearance_m = self.settings.clearance_m
        start_m = prediction.start_separation_m
        if start_m <= clearance_m:
            track.inside = track.met = True
        elif start_m > clearance_m + self.settings.clear_margin_m:
            track.inside = False
        about_to_touch = prediction.separation_m == 0 and start_m > TOUCHING_M
        wanted = self.settings.raise_probability
        if prediction.separation_m > clearance_m:
            wanted = max(wanted, SURE)
        likely = prediction.probability >= wanted
        return about_to_touch if track.inside else likely and prediction.contact_s > now_s

    def _holds(self, prediction: Prediction) -> bool:
        return prediction.probability >= self.settings.raise_probability * HELD_SHARE

    def _confirmed(self, track: Track, prediction: Prediction, now_s: float) -> bool:
        wanted = self.settings.confirm[0]
        return sum(track.looks) >= wanted or prediction.contact_s - now_s <= self.settings.urgent_s

    def _severity(self, prediction: Prediction, now_s: float, before: Severity | None) -> Severity:
        """By time to conflict; one level lower where more than half the clearance is left, or it may well not happen.

        A severity falls only once the time has grown by a second beyond its bound.
        """
        time_s = prediction.contact_s - now_s
        bounds_s = (self.settings.warning_s, self.settings.critical_s)
        shallow = prediction.separation_m > self.settings.clearance_m / 2 or prediction.probability < SURE

        def level(slack_s: float) -> int:
            reached = sum(time_s <= bound_s + slack_s for bound_s in bounds_s)
            return max(reached - 1, 0) if shallow else reached

        if before is None:
            return SEVERITIES[level(0.0)]
        return SEVERITIES[max(level(0.0), min(SEVERITIES.index(before), level(1.0)))]

    def _raised(self, prediction: Prediction, now_s: float, scene: Scene) -> ConflictAdvisory | None:
        pair = prediction.pair
        ordinal = self.ordinals[pair] = self.ordinals.get(pair, 0) + 1
        a, b = scene.party(pair[0]), scene.party(pair[1])
        if a is None or b is None:
            return None
        now, severity = _moment(now_s), self._severity(prediction, now_s, None)
        met = scene.meet(pair, prediction.contact_s)
        return ConflictAdvisory(
            id=str(uuid5(ADVISORIES, f"{pair[0]} {pair[1]} {round(now_s * 1e6)}")),
            revision=1,
            state=AdvisoryState.RAISED,
            encounter=ordinal,
            robots=pair,
            names=(a.name, b.name),
            vendors=(a.vendor, b.vendor),
            raised_at=now,
            **vars(self._telling(prediction, now_s, scene, (a, b), severity, met)),
        )

    def _updated(
        self, track: Track, before: ConflictAdvisory, prediction: Prediction, now_s: float, scene: Scene
    ) -> ConflictAdvisory | None:
        if before.time_to_conflict_s == 0 and prediction.contact_s <= now_s:
            return None
        severity = self._severity(prediction, now_s, before.severity)
        weighed = (prediction.contact_s, prediction.separation_m, prediction.probability, severity, before.revision)
        if weighed == track.weighed and not prediction.fresh:
            return None
        rises = SEVERITIES.index(severity) > SEVERITIES.index(before.severity)
        if not rises and now_s - before.updated_at.timestamp() < UPDATE_GAP_S:
            return None
        a, b = scene.party(before.robots[0]), scene.party(before.robots[1])
        if a is None or b is None:
            return None
        met = scene.meet(prediction.pair, prediction.contact_s)
        if not _differs(before, prediction, severity, met, scene.datum(met)):
            track.weighed = weighed
            return None
        told = self._telling(prediction, now_s, scene, (a, b), severity, met)
        return before.model_copy(
            update={
                "revision": before.revision + 1,
                "seq": 0,
                "state": AdvisoryState.UPDATED,
                **vars(told),
                "summary": advised(told.summary, before.recommendation, before.robots, before.names),
            }
        )

    def _telling(
        self,
        prediction: Prediction,
        now_s: float,
        scene: Scene,
        parties: tuple[Party, Party],
        severity: Severity,
        met: Encounter,
    ) -> Telling:
        time_s = max(prediction.contact_s - now_s, 0.0)
        return Telling(
            severity=severity,
            encounter_class=met.encounter_class,
            basis=(parties[0].basis, parties[1].basis),
            updated_at=_moment(now_s),
            predicted_at=_moment(prediction.contact_s),
            time_to_conflict_s=round(time_s, 3),
            probability=round(prediction.probability, 3),
            clearance_m=self.settings.clearance_m,
            min_separation_m=round(prediction.separation_m, 3),
            closing_speed_mps=round(met.closing_speed_mps, 3),
            location=Location(datum=scene.datum(met), x=round(met.x_m, 3), y=round(met.y_m, 3)),
            summary=_summary(parties, met, time_s, scene.place(met)),
        )

    def _standing(
        self, track: Track, advisory: ConflictAdvisory, now_s: float, scene: Scene
    ) -> ConflictAdvisory | None:
        """Clear a pair that met and now both stand: nothing more is predicted of it."""
        if not track.inside:
            return None
        parties = [scene.party(uuid) for uuid in advisory.robots]
        stand = all(one is not None and one.standing for one in parties)
        since_s = now_s - advisory.updated_at.timestamp()
        return self._cleared(advisory, now_s, STAND) if stand and since_s > self.settings.clear_after_s else None

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
        return self._cleared(advisory, now_s, PASSED if track.met else UNPREDICTED)

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
        return self._cleared(advisory, now_s, f"{' and '.join(names[uuid] for uuid in absent)} left the floor")

    def _cleared(self, advisory: ConflictAdvisory, now_s: float, because: str) -> ConflictAdvisory:
        now = _moment(now_s)
        return advisory.model_copy(
            update={
                "revision": advisory.revision + 1,
                "seq": 0,
                "state": AdvisoryState.CLEARED,
                "updated_at": now,
                "cleared_at": now,
                "cleared_because": because,
                "time_to_conflict_s": 0.0,
            }
        )


def _later(advisory: ConflictAdvisory | None, until_s: float) -> bool:
    return advisory is not None and advisory.predicted_at.timestamp() > until_s


def _moment(t_s: float) -> datetime:
    return datetime.fromtimestamp(t_s, UTC)


def _differs(before: ConflictAdvisory, prediction: Prediction, severity: Severity, met: Encounter, datum: str) -> bool:
    """Whether a person or a site service would act otherwise on what is told of a newer prediction."""
    return (
        severity != before.severity
        or met.encounter_class != before.encounter_class
        or abs((_moment(prediction.contact_s) - before.predicted_at).total_seconds()) > MOVED_S
        or abs(round(prediction.probability, 3) - (before.probability or 0.0)) > LIKELIER
        or abs(round(prediction.separation_m, 3) - before.min_separation_m) > DEEPER_M
        or datum != before.location.datum
        or hypot(round(met.x_m, 3) - before.location.x, round(met.y_m, 3) - before.location.y) > MOVED_M
    )


def _summary(parties: tuple[Party, Party], met: Encounter, time_s: float, place: str) -> str:
    a, b = parties
    if met.encounter_class is EncounterClass.STATIONARY_OBSTACLE and b.standing and not a.standing:
        what = f"{a.name} reaches {b.name}, which stands still,"
    elif met.encounter_class is EncounterClass.STATIONARY_OBSTACLE and a.standing and not b.standing:
        what = f"{b.name} reaches {a.name}, which stands still,"
    else:
        verb = {
            EncounterClass.HEAD_ON: "meet head-on",
            EncounterClass.CROSSING: "cross",
            EncounterClass.FOLLOWING: "close up in the same direction",
            EncounterClass.STATIONARY_OBSTACLE: "come close",
        }[met.encounter_class]
        what = f"{a.name} and {b.name} {verb}"
    return f"{what} in {time_s:.0f} s, {place}"
