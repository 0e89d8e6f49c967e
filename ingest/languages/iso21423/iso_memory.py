"""What is kept of a robot of ISO 21423 between two of its messages."""

from typing import NamedTuple

import msgspec

from ingest.languages.geometry.outlines import Outline
from ingest.languages.geometry.trajectories import Curve
from ingest.languages.iso21423.iso_messages import IdentityMessage, OdometryPose, Speeds
from ingest.languages.model import NO_PATH, Path
from ingest.languages.timestamps import Stamp
from ingest.languages.tolerance.heard import Heard


class IsoPose(NamedTuple):
    """The newest odometry."""

    stamp: Stamp
    pose: OdometryPose
    velocity: Speeds | None
    moves: bool
    """Whether the robot drives or turns, by its speeds, or else by the odometry before."""


class IsoWay(NamedTuple):
    """The newest global path."""

    curve: Curve
    datum: str
    """Of its first point."""


class IsoMemory(msgspec.Struct, frozen=True, gc=False):
    """All that is kept of a robot."""

    heard: dict[str, Heard] = {}
    """By resource."""
    respelt: frozenset[str] = frozenset()
    """Resources of which any message had keys in another spelling."""
    identity: IdentityMessage | None = None
    outline: Outline | None = None
    """The active footprint; None if only the identity has one."""
    height_m: float | None = None
    """With the active footprint."""
    pose: IsoPose | None = None
    states: tuple[str, ...] = ()
    path: Path = NO_PATH
    path_stamp_s: float = 0.0
    plan: Path = NO_PATH
    way: IsoWay | None = None
    battery_pct: float | None = None


NOTHING = IsoMemory()
