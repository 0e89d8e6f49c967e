"""The fields and the text of a conflict advisory's revisions. Whether a revision is due, others decide."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from hashlib import sha1
from typing import TYPE_CHECKING, NamedTuple, TypedDict
from uuid import UUID

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.document_limits import (
    MOST_EVENT_BYTES,
    MOST_HEADLINE_BYTES,
    MOST_NAME_BYTES,
    MOST_SUMMARY_BYTES,
    short_text,
)
from deconflict.advisories.words.words import Spot
from deconflict.foresight.conflict_predictions import Prediction
from deconflict_client.advisory import (
    AdvisoryState,
    ClearedCode,
    ConflictAdvisory,
    EncounterClass,
    Location,
    NamedPlace,
    Recommendation,
    Severity,
    moment,
)
from deconflict_client.participant_kinds import ParticipantKind
from ingest.batch import Pair

if TYPE_CHECKING:  # the operator face makes situations without numba
    from deconflict.sweep.geometry.encounter import Encounter

ADVISORIES = UUID("5f3d2f5e-6d0b-5a53-9f0a-3f0f3a0a7c11")
"""Namespace of advisory ids."""
_NAMESPACE = sha1(ADVISORIES.bytes, usedforsecurity=False)
WIDE_INTERVAL = 0.2
"""A probability comes with its interval if that is at least so wide."""

ENCOUNTER_VERBS = {
    EncounterClass.HEAD_ON: "meet head-on",
    EncounterClass.CROSSING: "cross",
    EncounterClass.FOLLOWING: "close up in the same direction",
    EncounterClass.STATIONARY_OBSTACLE: "come close",
}


@dataclass(frozen=True, slots=True)
class Party:
    """What an advisory says of one robot."""

    name: str
    vendor: str
    basis: str
    """What its forecast rests on, as `ConflictAdvisory.basis` has it."""
    standing: bool
    silent_s: float | None = None
    """How long it has been silent; None if it reports."""
    participant: ParticipantKind = "robot"

    @property
    def described(self) -> str:
        """Its name, with how long it has been silent."""
        return self.name if self.silent_s is None else f"{self.name}, silent for {self.silent_s:.0f} s"

    @property
    def subject(self) -> str:
        """The same as the subject of a sentence."""
        return self.described if self.silent_s is None else f"{self.described},"


class Absence(NamedTuple):
    """Why a robot is not on the floor."""

    code: ClearedCode
    by: str = ""
    """Name of the robot that has driven through its place."""


GONE = Absence(ClearedCode.LEFT)


class Texts(TypedDict):
    """The fields of an advisory that are sentences, and the places that these name."""

    places: tuple[NamedPlace, ...]
    headline: str
    event: str
    summary: str


class RevisionFields(Texts):
    """The fields of an advisory that follow from its newest prediction."""

    participants: tuple[ParticipantKind, ParticipantKind]
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


def revision_fields(
    prediction: Prediction,
    now_s: float,
    datum: str,
    spot: Spot,
    parties: tuple[Party, Party],
    severity: Severity,
    met: "Encounter",
    clearance_m: float,
) -> RevisionFields:
    """The fields that follow from a prediction of two robots that meet like `met`, at `spot` of a datum."""
    time_s = max(prediction.contact_s - now_s, 0.0)
    return RevisionFields(
        participants=(parties[0].participant, parties[1].participant),
        severity=severity,
        encounter_class=met.encounter_class,
        basis=(parties[0].basis, parties[1].basis),
        updated_at=moment(now_s),
        predicted_at=moment(prediction.contact_s),
        time_to_conflict_s=round(time_s, 3),
        probability=round(prediction.probability, 3),
        probability_interval=_interval(prediction),
        contact_probability=round(min(prediction.contact_probability, prediction.probability), 3),
        clearance_m=clearance_m,
        min_separation_m=round(prediction.separation_m, 3),
        closing_speed_mps=round(met.closing_speed_mps, 3),
        location=Location(datum=datum, x=round(met.x_m, 3), y=round(met.y_m, 3)),
        **_texts(parties, met, time_s, spot),
    )


def raised(
    pair: Pair, ordinal: int, parties: tuple[Party, Party], fields: RevisionFields, now_s: float
) -> ConflictAdvisory:
    """The first revision of an advisory on the encounter of a pair with this ordinal."""
    a, b = parties
    return ConflictAdvisory(
        id=new_id(f"{pair[0]} {pair[1]}", now_s),
        revision=1,
        state=AdvisoryState.RAISED,
        encounter=ordinal,
        robots=pair,
        names=(short_text(a.name, MOST_NAME_BYTES), short_text(b.name, MOST_NAME_BYTES)),
        vendors=(a.vendor, b.vendor),
        raised_at=fields["updated_at"],
        **fields,
    )


def new_id(about: str, now_s: float) -> str:
    """The id of an advisory that is raised now: a version 7 UUID (RFC 9562). In place of its random digits is a hash of
    `about` and the time.

    Ids are in the order of their milliseconds. So the store keeps what is open together, however much it holds.
    """
    hashed = _NAMESPACE.copy()
    hashed.update(f"{about} {round(now_s * 1e6)}".encode())
    digits, now_ms = hashed.hexdigest(), f"{int(now_s * 1000) % (1 << 48):012x}"
    variant = "89ab"[int(digits[3], 16) % 4]
    return f"{now_ms[:8]}-{now_ms[8:]}-7{digits[:3]}-{variant}{digits[4:7]}-{digits[7:19]}"


def updated(before: ConflictAdvisory, fields: RevisionFields) -> ConflictAdvisory:
    """The next revision, by a newer prediction; the advice stays."""
    return before.next_revision(**fields | {"summary": with_actions(fields["event"], before.recommendation)})


def with_probability(
    before: ConflictAdvisory, probability: float, severity: Severity, now_s: float
) -> ConflictAdvisory:
    """The next revision if only the probability has changed, and the severity by it."""
    return before.next_revision(
        severity=severity,
        updated_at=moment(now_s),
        time_to_conflict_s=round(before.time_left_s(now_s), 3),
        probability=round(probability, 3),
        probability_interval=None,
        contact_probability=None,
    )


def with_silence(
    before: ConflictAdvisory, parties: tuple[Party, Party], met: "Encounter", spot: Spot, now_s: float
) -> ConflictAdvisory:
    """The next revision if only a robot has fallen silent."""
    time_s = before.time_left_s(now_s)
    texts = _texts(parties, met, time_s, spot)
    return before.next_revision(
        updated_at=moment(now_s),
        time_to_conflict_s=round(time_s, 3),
        basis=(parties[0].basis, parties[1].basis),
        **texts | {"summary": with_actions(texts["event"], before.recommendation)},
    )


def with_advice(before: ConflictAdvisory, advice: Recommendation, now_s: float) -> ConflictAdvisory:
    """The next revision if only the advice has changed. Its holds and actions count from now on."""
    advice = advice.model_copy(update={"given_at": moment(now_s)})
    return before.next_revision(
        updated_at=moment(now_s),
        time_to_conflict_s=round(before.time_left_s(now_s), 3),
        recommendation=advice,
        summary=with_actions(before.event or _meeting(*before.names, before.encounter_class), advice),
    )


def with_actions(event: str, advice: Recommendation | None) -> str:
    """The summary: what happens, followed by the actions advised, or else by the note."""
    if advice is None:
        return event
    actions = [action_text(action) for action in advice.actions if action.action != "go_first"]
    return short_text("; ".join([event, *(actions or filter(None, [advice.note]))]), MOST_SUMMARY_BYTES)


def cleared_as_absent(advisory: ConflictAdvisory, absent: Mapping[str, Absence | None]) -> tuple[ClearedCode, str]:
    """Why an advisory is cleared of which these robots are not there; the code is that of the first."""
    names = dict(zip(advisory.robots, advisory.names, strict=True))
    absences = {names[uuid]: absence or GONE for uuid, absence in absent.items()}
    if set(absences.values()) == {GONE}:
        absences = {" and ".join(absences): GONE}
    texts = [code.because.format(name=name, by=by) for name, (code, by) in absences.items()]
    return next(iter(absences.values())).code, "; ".join(texts)


def _interval(prediction: Prediction) -> tuple[float, float] | None:
    """The interval that holds the probability with 90 %; None if it is narrow."""
    if prediction.upper - prediction.lower < WIDE_INTERVAL:
        return None
    return round(prediction.lower, 3), round(prediction.upper, 3)


def _texts(parties: tuple[Party, Party], met: "Encounter", time_s: float, spot: Spot) -> Texts:
    """What happens, with the time and without it."""
    a, b = parties
    is_obstacle = met.encounter_class is EncounterClass.STATIONARY_OBSTACLE
    if is_obstacle and b.standing and not a.standing:
        what, pause = f"{a.subject} reaches {_obstacle(b)}", ","
    elif is_obstacle and a.standing and not b.standing:
        what, pause = f"{b.subject} reaches {_obstacle(a)}", ","
    else:
        what, pause = _meeting(a.subject, b.subject, met.encounter_class), ""
    headline = short_text(f"{what}, {spot.text}", MOST_HEADLINE_BYTES)
    event = short_text(f"{what}{pause} in {time_s:.0f} s, {spot.text}", MOST_EVENT_BYTES)
    return Texts(places=spot.places, headline=headline, event=event, summary=event)


def _meeting(a: str, b: str, encounter_class: EncounterClass) -> str:
    return f"{a} and {b} {ENCOUNTER_VERBS[encounter_class]}"


def _obstacle(party: Party) -> str:
    return f"{party.name}, which stands still" if party.silent_s is None else party.described
