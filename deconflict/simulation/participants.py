"""The participants of the simulation: robots of four vendors, and the properties of each vendor's robots."""

from dataclasses import dataclass, replace
from enum import StrEnum
from uuid import UUID, uuid5

from ingest.languages.vda5050.vda_front_end import robot_uuid

FLEET = UUID("5a1c7c9e-6f0b-5c7e-9d3e-0b1f6f6a2d44")
"""Namespace of the simulated robots' UUIDs."""


class VendorName(StrEnum):
    ALDER = "Alder"
    CORVID = "Corvid"
    BASALT = "Basalt"
    WALKERS = "Walkers"


class Protection(StrEnum):
    """How a robot reacts to bodies on its path."""

    STOP = "stop"
    """It brakes, and stands until the path is clear."""
    SLOW = "slow"
    """It slows down as they come nearer, then stops."""
    SWERVE = "swerve"
    """It drives around them if there is room, otherwise it stops."""
    ATTEND = "attend"
    """A person, who sees where others go and keeps clear of them."""


@dataclass(frozen=True, slots=True)
class BodySize:
    """An envelope: length along the heading, width across it, and its centre ahead of the reported location."""

    length_m: float
    width_m: float
    ahead_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Chassis:
    """How a robot is built and drives, or a person walks."""

    body: BodySize
    loaded: BodySize
    height_m: float
    max_speed_mps: float
    gain_mps2: float
    """Greatest acceleration."""
    brake_mps2: float
    stop_gap_m: float
    """Length of the protective field beyond the stopping distance."""
    lane_m: float
    """Distance of its path to the right of the middle of an aisle."""
    turn_radps: float
    """Turn rate when turning in place."""
    protection: Protection

    @property
    def person(self) -> bool:
        return self.protection is Protection.ATTEND


@dataclass(frozen=True, slots=True, kw_only=True)
class Make(Chassis):
    """The properties of one vendor's robots."""

    vendor: VendorName
    model: str
    tells_waiting: bool = False
    """Whether it reports that it waits for others. Otherwise it reports a path as if it continued at once."""
    report_every_s: float = 1.0


ALDER = Make(
    BodySize(1.0, 0.7),
    BodySize(1.0, 0.7),
    0.4,
    1.4,
    0.8,
    1.4,
    0.45,
    0.70,
    vendor=VendorName.ALDER,
    model="A100",
    turn_radps=1.2,
    protection=Protection.STOP,
)
CORVID = Make(
    BodySize(1.4, 0.9),
    BodySize(1.4, 0.9),
    2.1,
    1.0,
    0.5,
    1.0,
    0.5,
    0.80,
    vendor=VendorName.CORVID,
    model="C20",
    turn_radps=0.8,
    protection=Protection.SLOW,
    tells_waiting=True,
)
TUG = replace(CORVID, model="C40", body=BodySize(1.6, 0.9, 0.4), loaded=BodySize(1.6, 0.9, 0.4), height_m=1.6)
"""A tug with trailers. The site file describes them."""
BASALT = Make(
    BodySize(1.1, 0.8, 0.2),
    BodySize(1.2, 1.0, 0.25),
    0.35,
    1.2,
    0.7,
    1.2,
    0.4,
    0.85,
    vendor=VendorName.BASALT,
    model="B7",
    turn_radps=1.0,
    protection=Protection.SWERVE,
)
"""Its reported location is its drive axle, behind the centre of its envelope. A load extends over the body."""
WALKER = Make(
    BodySize(0.5, 0.5),
    BodySize(0.5, 0.5),
    1.8,
    1.4,
    1.5,
    2.5,
    0.3,
    0.60,
    vendor=VendorName.WALKERS,
    model="H1",
    turn_radps=2.5,
    protection=Protection.ATTEND,
    tells_waiting=True,
    report_every_s=2.0,
)
MAKES = (ALDER, CORVID, BASALT, WALKER)


@dataclass(frozen=True, slots=True)
class Participant:
    """One robot, or one person with a device."""

    number: int
    """Number within its vendor, from 1."""
    make: Make

    @property
    def name(self) -> str:
        return f"{self.make.vendor}-{self.number:02}"

    @property
    def serial(self) -> str:
        return f"{self.make.model}-{self.number:04}"

    @property
    def uuid(self) -> str:
        """The same in each standard. VDA 5050 has none; Basalt's robots have the one that follows from their names."""
        if self.make.vendor is VendorName.BASALT:
            return robot_uuid(self.make.vendor, self.serial)
        return str(uuid5(FLEET, self.name))


def participants(robots: int) -> tuple[Participant, ...]:
    """`robots` participants, with the vendors in turn."""
    return tuple(Participant(1 + index // len(MAKES), MAKES[index % len(MAKES)]) for index in range(robots))
