"""What a message in any language says: an identity, a status, an update, or why it is rejected."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import hypot, nan, pi

import msgspec
import numpy as np

from ingest.batch import Amounts, Basis
from ingest.languages.rules import Findings, Oddity, RejectedError
from ingest.shapes import Shape
from ingest.sizes.stated_bodies import Figure, StatedBody
from ingest.sizes.stated_loads import StatedLoad

MOST_CODES, MOST_CODE_LETTERS = 100, 200
"""Error codes that are read of a status, and of each of them."""
MAX_REASON = 300
"""Characters kept of a rejection's reason."""
MAX_TEXT = 100
"""Characters kept of a name: it is in every batch and advisory of its robot."""
MAX_POSITION = 1e7
"""Metres or degrees. A location beyond it is absurd."""
MAX_SPEED_MPS = 100.0
"""No robot is faster."""
BESIDE_M = 1.0
"""A path that puts a robot further than this from its pose is not followed, if the pose came without it."""

Row = tuple[float, float, float, float]
"""t_s, x, y, yaw_rad: time by the sender's clock, place in the sender's frame and unit. The yaw is nan if unknown."""


class Path(msgspec.Struct, frozen=True, gc=False, eq=False):
    """Timed poses as sent."""

    poses: tuple[Row, ...]
    """(p,)"""
    datums: tuple[str, ...]
    """(p,) in lower case; "" is the robot's own datum."""
    in_order: bool
    """Whether each pose is later than the one before."""
    ends_s: tuple[float, float]
    """The first and the last time; nan if there is no pose."""
    most: tuple[float, ...] = ()
    """(p,) the greatest speed on the way to each pose, or the greatest turn rate where it turns on the spot; inf if
    none is stated. The robot drives at its own pace. Empty if the times are the robot's own."""
    ends_in_stop: bool = False
    """Whether it is known that the robot stops where the path ends."""

    @property
    def times(self) -> list[float]:
        """(p,)"""
        return [row[0] for row in self.poses]


NO_PATH = Path((), (), in_order=True, ends_s=(nan, nan))


def datum_name(sent: str | None) -> str:
    """A datum as `Path` and `Status` have it."""
    return (sent or "").strip().lower()


def only_datum(named: Iterable[str]) -> str:
    """The datum of a robot's own messages that one without a datum is on. "" unless there is just one."""
    datums = {*named} - {""}
    return datums.pop() if len(datums) == 1 else ""


def goes_on_beside(path: Path, t_s: float, x: float, y: float) -> bool:
    """Whether a path goes on after a time at which it puts the robot near a place. It may also begin later."""
    times = path.times
    if not path.ends_s[1] > t_s or times != sorted(times):
        return False
    path_x, path_y = (np.interp(t_s, times, [row[axis] for row in path.poses]) for axis in (1, 2))
    return path.ends_s[0] > t_s or hypot(path_x - x, path_y - y) <= BESIDE_M


class Identity(msgspec.Struct, frozen=True, gc=False, eq=False, kw_only=True):
    """Who a robot is, as far as prediction needs it."""

    uuid: str
    stamp_s: float
    """Time of the message by the sender's clock."""
    manufacturer: str
    model: str
    serial: str
    """Serial number."""
    envelope_m: tuple[float, float, float]
    """Length, width and height as stated, 0 if unknown. `ingest/sizes` judges them."""
    offset_m: tuple[float, float] = (0.0, 0.0)
    """From the reported location to the centre of the envelope: along the heading, and to its left."""
    outline: Shape | None = None
    """Around the reported location; None for a rectangle."""
    figures: tuple[Figure, ...] = ()
    """Other sizes in the message, which may show in which unit the envelope is."""
    max_speed_mps: float | None
    """None if it was not sent."""
    findings: tuple[str, ...]
    """Codes of the rules from which the message deviates."""
    oddities: tuple[Oddity, ...] = ()
    """The values that deviate, as far as they are named."""

    @property
    def has_size(self) -> bool:
        return min(self.envelope_m[:2]) > 0.0

    def sized_as(self, before: "Identity | None") -> "Identity":
        """With the size of an identity before it of the same model, if it says none itself."""
        if self.has_size or before is None or before.model != self.model:
            return self
        size = {name: getattr(before, name) for name in ("envelope_m", "offset_m", "outline")}
        return msgspec.structs.replace(self, **size)

    @property
    def body(self) -> StatedBody:
        return StatedBody(self.envelope_m, self.offset_m, self.outline)

    @property
    def distinguishing(self) -> tuple[object, ...]:
        """What makes it another robot if it changes."""
        return self.manufacturer, self.model, self.serial, self.envelope_m

    def says_the_same(self, other: "Identity") -> bool:
        """Whether all that it says of the robot is in the other one too, which may be of another time."""
        mine, others = (msgspec.structs.replace(each, stamp_s=0.0, findings=(), oddities=()) for each in (self, other))
        return msgspec.structs.astuple(mine) == msgspec.structs.astuple(others)


def beyond_turn(angle_rad: float | None) -> float:
    """An angle as it was sent if it is beyond a full turn, as one in degrees may be; else nan."""
    return nan if angle_rad is None or abs(angle_rad) <= 2 * pi else angle_rad


class Status(msgspec.Struct, frozen=True, gc=False, eq=False):
    """Where a robot is and will be, as sent: times by its own clock, places in its own frame and unit."""

    uuid: str
    stamp_s: float
    """Time of the pose."""
    stamp_resolution_s: float
    """Smallest difference that the stamp can show, 1 for whole seconds; inf if there is no stamp that can be read."""
    state: str
    """Operational state: as the schema spells it, or as the sender does if the standard does not have it."""
    known_state: bool
    """Whether the standard has the state."""
    x: float
    """Reported location, in the frame of `datum`."""
    y: float
    z: float
    """Height, 0 if it was not sent."""
    yaw_rad: float
    """Heading, anticlockwise from x; nan if unknown."""
    datum: str
    """In lower case; "" if none was sent."""
    linear_mps: float | None
    """Speed along the heading, or in the direction of `sideways_rad`. None if it was not sent, as for
    `turn_rad_per_s`."""
    turn_rad_per_s: float | None
    """The rotation made in one second."""
    amounts: Amounts
    error_codes: tuple[str, ...]
    """At most `MOST_CODES`, each with at most `MOST_CODE_LETTERS` characters."""
    destinations: Path
    path: Path
    findings: tuple[str, ...]
    """Codes of the rules from which the message deviates."""
    path_basis: Basis = Basis.PATH
    """What the path is derived from: the robot's own times, or an order."""
    is_blocked: bool = False
    """Whether it can't move, whatever its error codes are."""
    is_hindered: bool = False
    """Whether it reports what blocks robots, and says that it drives: it can't move if it goes on standing."""
    is_lost: bool = False
    """Whether it does not know where it is, whatever its error codes are."""
    deviation_m: float = 0.0
    """How far off its position may be, as far as the robot knows."""
    loads: tuple[StatedLoad, ...] = ()
    """Its loads, as far as it says where they are. `ingest/sizes` judges their size."""
    reports_within_s: float = 0.0
    """The next status may come as late as this by the rules of the language; 0 if it has no such rule."""
    oddities: tuple[Oddity, ...] = ()
    """The values that deviate, as far as they are named."""
    heading_sent: float = nan
    """The number that was sent as heading, if it is beyond a full turn; else nan."""
    sideways_rad: float = 0.0
    """From the heading to the direction in which the robot drives; 0 if it drives along its heading."""


class Update(msgspec.Struct, frozen=True, gc=False, eq=False):
    """A message that changes what is known of a robot but has no pose of its own, as an order."""

    uuid: str
    findings: tuple[str, ...]
    """Codes of the rules from which the message deviates."""
    oddities: tuple[Oddity, ...] = ()
    """The values that deviate, as far as they are named."""


@dataclass(frozen=True, slots=True)
class Rejection:
    """Why a message is not accepted."""

    rule: str
    """Code of the rule that rejects it."""
    reason: str
    """A sentence for the sender that says what to change."""
    uuid: str | None = None
    """The robot's UUID; None if it could not be read."""
    findings: tuple[str, ...] = ()
    """Codes of further rules from which the message deviates."""
    oddities: tuple[Oddity, ...] = ()
    """The values that deviate, as far as they are named."""


Message = Identity | Status | Update | Rejection


def update_of(uuid: str, findings: Findings) -> Update:
    """A message without a pose, with what was found in it."""
    return Update(uuid, tuple(findings), tuple(findings.oddities))


def rejection_of(error: RejectedError, uuid: str | None, findings: Findings) -> Rejection:
    """Why a message is not accepted, with what else was found in it."""
    return Rejection(error.rule, error.reason[:MAX_REASON], uuid, tuple(findings), tuple(findings.oddities))


def bounded_codes(codes: Sequence[str]) -> tuple[str, ...]:
    """The error codes that are read."""
    return tuple(code[:MOST_CODE_LETTERS] for code in codes[:MOST_CODES])
