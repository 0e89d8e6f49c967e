"""What is told of a conflict: the words and figures of an advisory, and when a newer prediction says something else."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from hashlib import sha1
from math import hypot, inf
from typing import NamedTuple, TypedDict
from uuid import UUID

import numpy as np

from deconflict.advisory import (
    AdvisoryState,
    ConflictAdvisory,
    EncounterClass,
    Location,
    Recommendation,
    Severity,
    moment,
)
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter, Encounters
from ingest.batch import Bools, Floats, Pair

ADVISORIES = UUID("5f3d2f5e-6d0b-5a53-9f0a-3f0f3a0a7c11")
"""Namespace of advisory ids."""
_NAMESPACE = sha1(ADVISORIES.bytes, usedforsecurity=False)
MOVED_S, MOVED_M, DEEPER_M = 0.75, 1.0, 0.15
"""Changes of predicted time, place and separation that are worth a revision."""
UPDATE_GAP_S = 1.0
"""At most one revision in this time, unless the severity rises."""
FADES_S = 1.0
"""A conflict has been unlikely for so long when its advisory tells so."""
THIN = 0.2
"""A probability comes with its interval where that is at least so wide."""
LIKELIER = 0.15
"""A change of probability that is worth a revision."""
SURE = 0.8
"""A conflict less likely than this is one level less severe, and none where the forecasts as they stand miss."""
SLACK_S = 1.0

_VERBS = {
    EncounterClass.HEAD_ON: "meet head-on",
    EncounterClass.CROSSING: "cross",
    EncounterClass.FOLLOWING: "close up in the same direction",
    EncounterClass.STATIONARY_OBSTACLE: "come close",
}

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
    """That the two get in each other's way in the horizon."""
    contact_probability: float = 1.0
    """That their envelopes come within the clearance in the horizon."""
    lower: float = 1.0
    """Ends of the interval that holds the probability with 90 %."""
    upper: float = 1.0
    deciding: float = 1.0
    """What alerts are decided by: above the probability where evidence is thin."""
    still: bool = False
    """Both stay where they stand, or one gave way to the other lately."""
    there: float = 1.0
    """How likely both robots are still there."""


class Predictions(NamedTuple):
    """Many of them, in columns (n,)."""

    pairs: Sequence[Pair]
    contact_s: Floats
    separation_m: Floats
    start_separation_m: Floats
    fresh: Bools
    probability: Floats
    contact_probability: Floats
    lower: Floats
    upper: Floats
    deciding: Floats
    still: Bools
    there: Floats

    def until(self, end_s: float) -> "Predictions":
        """Those of what begins by then."""
        if end_s == inf:
            return self
        rows = np.flatnonzero(self.contact_s <= end_s)
        if len(rows) == len(self.pairs):
            return self
        columns = {name: column[rows] for name, column in self._asdict().items() if name != "pairs"}
        return self._replace(pairs=[self.pairs[row] for row in rows.tolist()], **columns)

    def some(self, rows: Sequence[int]) -> list[Prediction]:
        columns = (map(column.item, rows) for column in self[1:])
        return list(map(Prediction._make, zip(map(self.pairs.__getitem__, rows), *columns, strict=True)))


@dataclass(frozen=True, slots=True)
class Party:
    """What an advisory says of one robot."""

    name: str
    vendor: str
    basis: str
    standing: bool
    silent_s: float | None = None
    """For how long it has been silent; None where it is heard."""

    @property
    def called(self) -> str:
        """Its name, and whether it is silent."""
        return self.name if self.silent_s is None else f"{self.name}, silent for {self.silent_s:.0f} s,"


@dataclass(frozen=True, slots=True)
class Scene:
    """What the life of advisories asks of the engine's state."""

    here: Callable[[str], bool]
    """Whether a robot is on the floor."""
    absence: Callable[[str], str | None]
    """Why a robot is not there, in words that follow its name; None where it is, for all that is known."""
    party: Callable[[str], Party]
    """For a robot that is."""
    stands: Callable[[str], bool]
    """Whether a robot is on the floor and stands there."""
    meet: Callable[[Pair, float], Encounter]
    encounters: Callable[[Sequence[Pair], Floats], Encounters]
    """How each of some pairs meets at its time, but for rounding errors; the place is nan where it is not known."""
    separation_m: Callable[[Pair, float], float | None]
    """None where the two cannot be compared."""
    datum: Callable[[Encounter], str]
    """The datum's id."""
    places: Callable[[Sequence[Encounter]], list[str]]
    """Where on it each is, in words."""


class Where(NamedTuple):
    """Where two meet."""

    datum: str
    """The datum's id."""
    place: str
    """In words."""


class Telling(TypedDict):
    """The fields of an advisory that follow from its newest prediction."""

    severity: Severity
    encounter_class: EncounterClass
    basis: tuple[str, str]
    updated_at: datetime
    predicted_at: datetime
    time_to_conflict_s: float
    probability: float
    probability_interval: tuple[float, float] | None
    contact_probability: float
    clearance_m: float
    min_separation_m: float
    closing_speed_mps: float
    location: Location
    summary: str


def is_news(before: ConflictAdvisory, prediction: Prediction, severity: Severity, met: Encounter, datum: str) -> bool:
    """Whether a person or a site service would act otherwise on what is told of a newer prediction."""
    return (
        severity != before.severity
        or met.encounter_class != before.encounter_class
        or abs((moment(prediction.contact_s) - before.predicted_at).total_seconds()) > MOVED_S
        or is_likelier(before, prediction.probability)
        or abs(round(prediction.separation_m, 3) - before.min_separation_m) > DEEPER_M
        or datum != before.location.datum
        or hypot(round(met.x_m, 3) - before.location.x, round(met.y_m, 3) - before.location.y) > MOVED_M
    )


def is_likelier(before: ConflictAdvisory, probability: float) -> bool:
    """Whether a person would act otherwise on the probability, grown or fallen."""
    return abs(round(probability, 3) - (before.probability or 0.0)) > LIKELIER


def severity_of(prediction: Prediction, now_s: float, before: Severity | None, settings: Conflict) -> Severity:
    """By time to conflict; one level lower where more than half the clearance is left, or it may well not happen.

    A severity falls only once the time has grown by `SLACK_S` beyond its bound.
    """
    time_s = prediction.contact_s - now_s
    shallow = prediction.separation_m > settings.clearance_m / 2 or prediction.probability < SURE

    def level(slack_s: float) -> int:
        reached = (time_s <= settings.warning_s + slack_s) + (time_s <= settings.critical_s + slack_s)
        return max(reached - 1, 0) if shallow else reached

    least = level(0.0)
    return SEVERITIES[least if before is None else max(least, min(SEVERITIES.index(before), level(SLACK_S)))]


def severity_until_s(contact_s: float, now_s: float, settings: Conflict) -> float:
    """When time alone next changes what `severity_of` says of a conflict at that time."""
    bounds_s = (settings.warning_s, settings.critical_s)
    changes_s = [contact_s - bound_s - slack_s for bound_s in bounds_s for slack_s in (SLACK_S, 0.0)]
    return min((at_s for at_s in changes_s if at_s > now_s), default=inf)


def newest(
    prediction: Prediction,
    now_s: float,
    where: Where,
    parties: tuple[Party, Party],
    severity: Severity,
    met: Encounter,
    clearance_m: float,
) -> Telling:
    """What there is to tell of a prediction, by which the two meet so, there."""
    time_s = max(prediction.contact_s - now_s, 0.0)
    return Telling(
        severity=severity,
        encounter_class=met.encounter_class,
        basis=(parties[0].basis, parties[1].basis),
        updated_at=moment(now_s),
        predicted_at=moment(prediction.contact_s),
        time_to_conflict_s=round(time_s, 3),
        probability=round(prediction.probability, 3),
        probability_interval=_interval(prediction),
        contact_probability=round(prediction.contact_probability, 3),
        clearance_m=clearance_m,
        min_separation_m=round(prediction.separation_m, 3),
        closing_speed_mps=round(met.closing_speed_mps, 3),
        location=Location(datum=where.datum, x=round(met.x_m, 3), y=round(met.y_m, 3)),
        summary=_summary(parties, met, time_s, where.place),
    )


def raised(pair: Pair, ordinal: int, parties: tuple[Party, Party], told: Telling, now_s: float) -> ConflictAdvisory:
    """The first revision of an advisory on a pair's encounter of that number."""
    a, b = parties
    return ConflictAdvisory(
        id=_id_of(f"{pair[0]} {pair[1]} {round(now_s * 1e6)}"),
        revision=1,
        state=AdvisoryState.RAISED,
        encounter=ordinal,
        robots=pair,
        names=(a.name, b.name),
        vendors=(a.vendor, b.vendor),
        raised_at=told["updated_at"],
        **told,
    )


def _id_of(name: str) -> str:
    """The version 5 UUID of a name among `ADVISORIES`; `uuid5` takes four times as long."""
    hashed = _NAMESPACE.copy()
    hashed.update(name.encode())
    digits = hashed.hexdigest()
    variant = "89ab"[int(digits[16], 16) % 4]
    return f"{digits[:8]}-{digits[8:12]}-5{digits[13:16]}-{variant}{digits[17:20]}-{digits[20:32]}"


def updated(before: ConflictAdvisory, told: Telling) -> ConflictAdvisory:
    """The next revision, of a newer prediction; the advice stands."""
    summary = advised(told["summary"], before.recommendation, before.robots, before.names)
    return before.followed(**told | {"summary": summary})


def with_probability(before: ConflictAdvisory, probability: float, now_s: float) -> ConflictAdvisory:
    """The next revision, of the same prediction where nothing has changed but how likely it is."""
    return before.followed(
        updated_at=moment(now_s),
        time_to_conflict_s=round(max(before.predicted_at.timestamp() - now_s, 0.0), 3),
        probability=round(probability, 3),
        probability_interval=None,
        contact_probability=None,
    )


def _interval(prediction: Prediction) -> tuple[float, float] | None:
    """What holds the probability with 90 %, where that is wide enough to be told."""
    if prediction.upper - prediction.lower < THIN:
        return None
    return round(prediction.lower, 3), round(prediction.upper, 3)


def with_silence(
    before: ConflictAdvisory, parties: tuple[Party, Party], met: Encounter, place: str, now_s: float
) -> ConflictAdvisory:
    """The next revision, of the same prediction where nothing has changed but that a robot has fallen silent."""
    time_s = max(before.predicted_at.timestamp() - now_s, 0.0)
    return before.followed(
        updated_at=moment(now_s),
        time_to_conflict_s=round(time_s, 3),
        basis=(parties[0].basis, parties[1].basis),
        summary=advised(_summary(parties, met, time_s, place), before.recommendation, before.robots, before.names),
    )


def with_advice(before: ConflictAdvisory, advice: Recommendation, now_s: float) -> ConflictAdvisory:
    """The next revision, of the same prediction with new advice."""
    return before.followed(
        updated_at=moment(now_s),
        time_to_conflict_s=round(max(before.predicted_at.timestamp() - now_s, 0.0), 3),
        recommendation=advice,
        summary=advised(before.summary.split(";")[0], advice, before.robots, before.names),
    )


def _summary(parties: tuple[Party, Party], met: Encounter, time_s: float, place: str) -> str:
    a, b = parties
    if met.encounter_class is EncounterClass.STATIONARY_OBSTACLE and b.standing and not a.standing:
        what = f"{a.called} reaches {_standing(b)}"
    elif met.encounter_class is EncounterClass.STATIONARY_OBSTACLE and a.standing and not b.standing:
        what = f"{b.called} reaches {_standing(a)}"
    else:
        what = f"{a.called} and {b.called} {_VERBS[met.encounter_class]}"
    return f"{what} in {time_s:.0f} s, {place}"


def _standing(party: Party) -> str:
    return f"{party.name}, which stands still," if party.silent_s is None else party.called


CHANGED_S = 1.0
"""A hold that differs by less is the same advice."""


def differs(before: Recommendation | None, after: Recommendation) -> bool:
    """Whether a site service would do otherwise."""
    if before is None:
        return True
    held, hold = ({one.robot: one.hold_s for one in each.holds} for each in (before, after))
    if held.keys() != hold.keys() or before.note != after.note:
        return True
    return any(abs(held[robot] - hold[robot]) > CHANGED_S for robot in held)


def advised(summary: str, advice: Recommendation | None, robots: Sequence[str], names: Sequence[str]) -> str:
    """The summary of an advisory with what is advised to its own robots."""
    if advice is None:
        return summary
    called = dict(zip(robots, names, strict=True))
    told = [f"{called[one.robot]} should wait {one.hold_s:g} s" for one in advice.holds if one.robot in called]
    return "; ".join([summary, *(told or ([advice.note] if advice.note else []))])
