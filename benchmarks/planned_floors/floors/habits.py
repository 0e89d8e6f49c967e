"""How the robots of a vendor behave and what they report, and the parameters of a floor."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Habits:
    """The robots of one vendor."""

    vendor: str
    robots: int
    protection: str = "stop"
    """`stop` brakes before a body in its field; `slow` slows down in a wider field first; `swerve` leaves its way
    where there is room, and stops where there is none."""
    path_s: int = 10
    """Length in seconds of the path in its reports; 0 for none."""
    tells_order: bool = True
    """Whether paths keep the order of the own fleet. Otherwise each robot plans as if it were alone."""
    tells_waiting: bool = False
    """Whether robots that stand for others report it. Otherwise they are always `navigating`."""
    report_every_s: float = 1.0
    """Time between two reports of a robot, plus or minus a tenth."""


@dataclass(frozen=True, slots=True)
class GridFloor:
    """A floor of cells with racks, and robots that run errands between random cells."""

    kind: str
    vendors: tuple[Habits, ...]
    seconds: float = 420.0
    width: int = 26
    """Cells."""
    height: int = 26
    layout: Literal["racks", "warehouse", "sortation", "scattered"] = "racks"
    aisle_cells: int = 2
    """Of `racks`."""
    one_way_x: tuple[int, ...] = ()
    """Columns in which nobody drives towards larger y."""
    stalls_per_s: float = 0.015
    """Probability that a robot stalls in a second."""
    stall_s: tuple[float, float] = (2.0, 10.0)
    silences_per_hour: float = 0.0
    """Of one robot."""
    silence_s: tuple[float, float] = (20.0, 90.0)
    carried_away: float = 0.4
    """Share of silences in which the robot is switched off and carried away."""
    drives_on: float = 0.2
    """Share of silences in which it drives on. In the rest it stands until it reports again."""
    patience_s: tuple[float, float] = (13.0, 17.0)
    """Least and greatest time for which a robot stands for another before it drives around it."""
    around_aside_m: float = 0.4
    """How far to the right of its way a robot drives around another."""
    turns_aside_m: float = 0.5
    """With at most this offset a robot may turn into its next leg."""
    seed: int = 1
