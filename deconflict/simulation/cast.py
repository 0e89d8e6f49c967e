"""Who takes part: four vendors' makes of robot, and a fleet of them."""

from dataclasses import dataclass
from enum import StrEnum
from uuid import UUID, uuid5

FLEET = UUID("5a1c7c9e-6f0b-5c7e-9d3e-0b1f6f6a2d44")
"""Namespace of the simulated robots' UUIDs."""


class VendorName(StrEnum):
    ALDER = "Alder"
    CORVID = "Corvid"
    BASALT = "Basalt"
    WALKERS = "Walkers"


class Protection(StrEnum):
    """What a robot does about bodies on its way."""

    STOP = "stop"
    """It brakes, and stands until they are gone."""
    SLOW = "slow"
    """It goes the slower the nearer they are, and then stops."""
    SWERVE = "swerve"
    """It goes past them where there is room, and else stops."""
    ATTEND = "attend"
    """A person: it sees where others go, and keeps off their way."""


@dataclass(frozen=True, slots=True)
class Body:
    """An envelope: length along the heading, width across it, and its centre ahead of the reported location."""

    length_m: float
    width_m: float
    ahead_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Make:
    """What robots of one vendor are like and how they drive."""

    vendor: VendorName
    model: str
    body: Body
    loaded: Body
    height_m: float
    max_speed_mps: float
    gain_mps2: float
    """Greatest acceleration."""
    brake_mps2: float
    stop_gap_m: float
    """How much longer than its stopping distance the field of its protective stop is."""
    lane_m: float
    """How far right of the middle of an aisle it keeps."""
    turn_radps: float
    """Turning in place."""
    protection: Protection
    tells_waiting: bool = False
    """Whether one that others keep standing says so; else it tells a path as if it went on at once."""
    report_every_s: float = 1.0

    @property
    def person(self) -> bool:
        return self.protection is Protection.ATTEND


ALDER = Make(
    VendorName.ALDER,
    "A100",
    Body(1.0, 0.7),
    Body(1.0, 0.7),
    0.4,
    1.4,
    0.8,
    1.4,
    0.45,
    0.70,
    turn_radps=1.2,
    protection=Protection.STOP,
)
CORVID = Make(
    VendorName.CORVID,
    "C20",
    Body(1.4, 0.9),
    Body(1.4, 0.9),
    2.1,
    1.0,
    0.5,
    1.0,
    0.5,
    0.80,
    turn_radps=0.8,
    protection=Protection.SLOW,
    tells_waiting=True,
)
BASALT = Make(
    VendorName.BASALT,
    "B7",
    Body(1.1, 0.8, 0.2),
    Body(1.2, 1.0, 0.25),
    0.35,
    1.2,
    0.7,
    1.2,
    0.4,
    0.85,
    turn_radps=1.0,
    protection=Protection.SWERVE,
)
"""Its location is that of its drive axle, behind the middle of its envelope; a load juts out."""
WALKER = Make(
    VendorName.WALKERS,
    "H1",
    Body(0.5, 0.5),
    Body(0.5, 0.5),
    1.8,
    1.4,
    1.5,
    2.5,
    0.3,
    0.60,
    turn_radps=2.5,
    protection=Protection.ATTEND,
    tells_waiting=True,
    report_every_s=2.0,
)
MAKES = (ALDER, CORVID, BASALT, WALKER)


@dataclass(frozen=True, slots=True)
class Member:
    """One robot, or one person with a device."""

    number: int
    """From 1, within its vendor."""
    make: Make

    @property
    def name(self) -> str:
        return f"{self.make.vendor}-{self.number:02}"

    @property
    def uuid(self) -> str:
        return str(uuid5(FLEET, self.name))


def cast(robots: int) -> tuple[Member, ...]:
    """So many participants, the vendors taking turns."""
    return tuple(Member(1 + index // len(MAKES), MAKES[index % len(MAKES)]) for index in range(robots))
