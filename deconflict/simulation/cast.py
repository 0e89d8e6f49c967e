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
    """Way left free before what the protective stop sees."""
    lane_m: float
    """How far right of the middle of an aisle it keeps."""
    turn_radps: float
    """Turning in place."""
    report_every_s: float = 1.0
    person: bool = False


ALDER = Make(VendorName.ALDER, "A100", Body(1.0, 0.7), Body(1.0, 0.7), 0.4, 1.4, 0.8, 1.4, 0.45, 0.47, turn_radps=1.2)
CORVID = Make(VendorName.CORVID, "C20", Body(1.4, 0.9), Body(1.4, 0.9), 2.1, 1.0, 0.5, 1.0, 0.5, 0.57, turn_radps=0.8)
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
    0.67,
    turn_radps=1.0,
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
    0.37,
    turn_radps=2.5,
    report_every_s=2.0,
    person=True,
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
