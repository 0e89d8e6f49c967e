"""The documents that the HTTP API reads and returns."""

import operator
from typing import Annotated, Any

from pydantic import BaseModel, Field, StringConstraints

from deconflict_client.advisory import AdviceAnswer, AnyAdvisory, Severity, SituationKind
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.answers.filter_models import Filtered
from deconflict_client.situations import AnyRevision, Situation

Document = dict[str, Any]


class AdvisoryList(Filtered):
    """The newest revision of each advisory that matches, newest first."""

    seq: int = Field(description="newest number at this moment; `/advisories/stream?after=` continues from it")
    advisories: list[AnyRevision]
    more: bool = Field(description="true if `limit` left some out")


class RevisionList(BaseModel):
    """Every stored revision of one advisory, in order."""

    advisories: list[AnyRevision]


class SituationList(Filtered):
    """The newest revision of each situation that matches, newest first."""

    seq: int = Field(description="newest number at this moment; `/advisories/stream?after=` continues from it")
    situations: list[Situation]
    more: bool = Field(description="true if `limit` left some out")


class SituationRevisions(BaseModel):
    """Every stored revision of one situation, in order."""

    situations: list[Situation]


class Answer(BaseModel):
    """Who acknowledges an advisory or a situation, and what is done about it or why nothing is done."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, max_length=80)] = Field(
        default="", description="required if people do not sign in; ignored if they do"
    )
    reason: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=500)]


class AdviceList(Filtered):
    """The newest revision of all advice that matches, newest first."""

    seq: int = Field(description="newest number at this moment; `/advisories/stream?after=` continues from it")
    advice: list[RobotAdvice]
    more: bool = Field(description="true if `limit` left some out")


class AdviceRevisions(BaseModel):
    """Every stored revision of one piece of advice, in order."""

    advice: list[RobotAdvice]


class VendorAnswer(BaseModel):
    """What a vendor answers for its robot."""

    answer: AdviceAnswer
    why: Annotated[str, StringConstraints(strip_whitespace=True, max_length=500)] = Field(
        default="",
        description='why it was declined: "cannot" if robots of this vendor never can, "busy" if this one can\'t now',
    )
    name: Annotated[str, StringConstraints(strip_whitespace=True, max_length=80)] = Field(
        default="", description="who answers, if programs do not sign in; ignored if they do"
    )


class NewOwner(BaseModel):
    """The vendor to which a robot belongs from now on."""

    vendor: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=80)]


class Owned(BaseModel):
    """Whose a robot is."""

    uuid: str
    vendor: str
    before: str | None = Field(description="the owner before; null if there was none")


class OffFloorStatement(BaseModel):
    """Whether a robot is off the floor, and who says so."""

    off_floor: bool = Field(True, description="false puts it back")
    name: Annotated[str, StringConstraints(strip_whitespace=True, max_length=80)] = Field(
        default="", description="required if people do not sign in; ignored if they do"
    )


class OffFloorState(BaseModel):
    """Whether a robot is off the floor now. The first statement counts until it is taken back."""

    uuid: str
    off_floor: bool
    by: str | None = Field(description="who said so; null if it is on the floor")
    at_s: float | None = Field(description="when, seconds since the epoch; null if it is on the floor")


class QuarantineList(BaseModel):
    """The rejected messages that are kept, each with its rule and reason."""

    rejected: list[Document]


class Reloaded(BaseModel):
    """The result of reading a changed site file."""

    applied: bool = Field(description="false if the file was refused; then the old settings stay in use")
    detail: str = Field(default="", exclude_if=operator.not_, description="why it was refused; absent if it was not")
    problems: list[str] = Field(description="what to change in the file")
    needs_restart: list[str] = Field(description="changed keys that are in use only after a restart")


class RefusedRequest(BaseModel):
    """Why there is no answer. Every answer with a status of 400 or above has it, except `/healthz`."""

    detail: str = Field(description="one sentence for people; of a wrong parameter or body, what is wrong where")


class Problem(RefusedRequest):
    """Why there is no answer, and the role that is the cause."""

    role: str


class Recorded(BaseModel):
    """The time that the recording covers, seconds since the epoch; null if there is no recording."""

    from_s: float | None
    to_s: float | None


class PastFloor(BaseModel):
    """The floor, the open situations and the open advisories at one moment."""

    floor: dict[str, Any] = Field(description="a frame as `/live` sends it")
    situations: list[Situation]
    advisories: list[AnyAdvisory]


class Heat(BaseModel):
    """Where advisories were raised: for each floor, `[x, y, count]` of each cell with any. x, y is its lower left."""

    since_s: float
    until_s: float
    cell_m: float
    floors: dict[str, list[tuple[float, float, int]]]


class ShiftSituation(BaseModel):
    """A situation of a shift."""

    situation: Situation = Field(description="its newest revision")
    first_kind: SituationKind = Field(description="its kind when it was raised")
    worst_severity: Severity
    most_cost_s: float = Field(description="the most seconds that its robots were expected to lose")


class Shift(BaseModel):
    """The situations that were open since a time, newest first."""

    since_s: float
    complete: bool = Field(description="false if older ones were left out")
    counts: dict[SituationKind, int] = Field(
        description="how many, by the kind that each had when it was raised, as metrics and a replay count them"
    )
    situations: list[ShiftSituation]


class Removed(BaseModel):
    """A silent robot through whose place another robot drove. It counts as gone until it reports again."""

    vendor: str
    name: str
    heard_s: float = Field(description="time of its last report, seconds since the epoch")
    at_s: float = Field(description="when the other robot drove through its place")
    by: str = Field(description="name of the other robot")


class Exit(BaseModel):
    """A place where robots usually leave: they fall silent there and do not come back."""

    datum: str
    x_m: float
    y_m: float
    robots: int = Field(description="number of robots that left there recently")


class StillThere(BaseModel):
    """The silent robots, by UUID: the probability that each is still there, those that are gone, and the exits."""

    fading: dict[str, float]
    taken_off: dict[str, Removed]
    exits: list[Exit]
    distrusted: list[str] = Field(
        [],
        description="robots that announce a path or an order and move otherwise: for 10 s on end, and until 30 s after",
    )
