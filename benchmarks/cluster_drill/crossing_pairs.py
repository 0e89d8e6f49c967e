"""Pairs of robots that cross each other's way by the clock."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi

from ingest.languages.vda5050.vda_front_end import robot_uuid
from tests.helpers.saying import robot
from tests.helpers.vda_saying import MAKER

GAP_S = 20.0
"""From one meeting of a pair to the next: its advisory ends, and nothing is foreseen for some seconds."""
REPORTS_A_SECOND, PATH_S, SPEED_MPS = 2, 10, 1.0
APART_M, COLUMNS = 50.0, 4
MASS, VDA, ISO = "massrobotics", "vda5050", "iso21423"
MIX = ((MASS, MASS), (MASS, MASS), (MASS, MASS), (MASS, VDA), (MASS, MASS), (VDA, ISO))
"""The languages of six pairs. Of these the last one of MassRobotics alone reports to two machines."""
SPLIT = 4
Pose = tuple[float, float, float]
"""x_m, y_m and yaw_rad."""


@dataclass(frozen=True, slots=True)
class CrossingPair:
    """Two robots of which each drives to and fro, and that are in the same place every `GAP_S`."""

    number: int
    pairs: int
    """How many there are."""
    machines: tuple[int, int]
    """At which machine each of the two reports first, if it is not at the broker."""
    languages: tuple[str, str]

    @property
    def kind(self) -> str:
        """Who hears the two: one machine, two, or whoever hears the broker."""
        if self.languages != (MASS, MASS):
            return "at broker"
        return "at one machine" if self.machines[0] == self.machines[1] else "at two machines"

    @property
    def uuids(self) -> tuple[str, ...]:
        return tuple(sorted(self.uuid(side) for side in (0, 1)))

    def uuid(self, side: int) -> str:
        name = self.name(side)
        return robot_uuid(MAKER, name) if self.languages[side] == VDA else robot(name)

    def name(self, side: int) -> str:
        return f"crossing-{self.number}-{side}"

    def meetings_s(self, since_s: float, until_s: float) -> list[float]:
        """When the two are in the same place, in seconds since the start."""
        first = ceil((since_s - self._late_s) / GAP_S - 0.5)
        times_s = [(number + 0.5) * GAP_S + self._late_s for number in range(first, first + int(until_s / GAP_S) + 2)]
        return [t_s for t_s in times_s if since_s <= t_s < until_s]

    def leg(self, t_s: float) -> int:
        """The number of the way that the two are driving. It is even forth and odd back."""
        return int((t_s - self._late_s) // GAP_S)

    def end_of_leg(self, side: int, leg: int, is_last: bool) -> Pose:
        """Where a way begins, or ends."""
        return self._pose(side, leg, GAP_S if is_last else 0.0)

    def pose(self, side: int, t_s: float) -> Pose:
        return self._pose(side, self.leg(t_s), (t_s - self._late_s) % GAP_S)

    def _pose(self, side: int, leg: int, part_s: float) -> Pose:
        along_m = SPEED_MPS * (part_s - GAP_S / 2) * (-1 if leg % 2 else 1)
        x, y = APART_M * (self.number % COLUMNS), APART_M * (self.number // COLUMNS)
        yaw = pi if leg % 2 else 0.0
        return (x + along_m, y, yaw) if side == 0 else (x, y + along_m, yaw + pi / 2)

    @property
    def _late_s(self) -> float:
        """Pairs meet one after another."""
        return GAP_S * self.number / self.pairs


def made_pairs(count: int, machines: Sequence[int]) -> list[CrossingPair]:
    """Pairs of all languages, which are spread over the machines."""
    pairs = []
    for number in range(count):
        first = number % len(machines)
        second = (number + (number % len(MIX) == SPLIT)) % len(machines)
        pairs.append(CrossingPair(number, count, (machines[first], machines[second]), MIX[number % len(MIX)]))
    return pairs
