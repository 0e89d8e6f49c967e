"""What a message of any language says: an identity, a status, or why it is rejected."""

from dataclasses import dataclass
from math import nan

import msgspec

Row = tuple[float, float, float, float]
"""t_s, x, y, yaw_rad, nan where the heading is unknown."""


class Path(msgspec.Struct, frozen=True, gc=False, eq=False):
    """Timed poses as sent."""

    poses: tuple[Row, ...]
    """(p,)"""
    datums: tuple[str, ...]
    """(p,) lower case; "" is the robot's own."""
    in_order: bool
    """Whether each is later than the one before."""
    ends_s: tuple[float, float]
    """The first time and the last; nan of no pose."""

    @property
    def times(self) -> list[float]:
        """(p,)"""
        return [row[0] for row in self.poses]


NO_PATH = Path((), (), in_order=True, ends_s=(nan, nan))


class Identity(msgspec.Struct, frozen=True, gc=False, eq=False, kw_only=True):
    """Who a robot is, as far as prediction needs it."""

    uuid: str
    stamp_s: float
    manufacturer: str
    model: str
    serial: str
    envelope_m: tuple[float, float, float]
    """Height 0 where unknown."""
    max_speed_mps: float | None
    findings: tuple[str, ...]


class Status(msgspec.Struct, frozen=True, gc=False, eq=False):
    """Where a robot is and will be, as sent: its own clock, its own frame."""

    uuid: str
    stamp_s: float
    stamp_resolution_s: float
    state: str
    """As the schema spells it, or the sender's own word."""
    known_state: bool
    x: float
    y: float
    z: float
    yaw_rad: float
    """nan where unknown."""
    datum: str
    """Lower case; "" where none was sent."""
    linear_mps: float | None
    turn_rad_per_s: float | None
    """The rotation made in one second."""
    load_used_pct: float | None
    battery_pct: float | None
    run_time_left_s: float | None
    """How much longer its battery lasts."""
    error_codes: tuple[str, ...]
    destinations: Path
    path: Path
    findings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Rejection:
    """A message that can't be understood: which rule, and what the sender should change."""

    rule: str
    reason: str
    uuid: str | None = None
    """Of the robot, where that much could be read."""
    findings: tuple[str, ...] = ()
