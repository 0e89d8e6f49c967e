"""When robots stall, and when they fall silent: standing, driving on, or carried away."""

from dataclasses import dataclass

import numpy as np

from benchmarks.planned_floors.floors.habits import GridFloor

CARRIED_AFTER_S = (0.0, 5.0)
"""A robot that is switched off is carried away within this time."""
AWAY_S = (60.0, 150.0)
"""It comes back after this."""


@dataclass(slots=True, eq=False)
class Absence:
    """One silence of one robot."""

    start_s: float
    end_s: float
    """When it reports again, or may come back."""
    gone_s: float | None
    """When it is carried away. None if it is not."""
    stands: bool


def drawn(floor: GridFloor, robots: int, rng: np.random.Generator) -> list[list[Absence]]:
    """The silences of each robot, in order."""
    return [_of_robot(floor, rng) for _ in range(robots)]


def _of_robot(floor: GridFloor, rng: np.random.Generator) -> list[Absence]:
    found: list[Absence] = []
    if floor.silences_per_hour <= 0:
        return found
    t_s = float(rng.exponential(3600 / floor.silences_per_hour))
    while t_s < floor.seconds:
        absence = _one(floor, t_s, rng)
        found.append(absence)
        t_s = absence.end_s + float(rng.exponential(3600 / floor.silences_per_hour))
    return found


def _one(floor: GridFloor, start_s: float, rng: np.random.Generator) -> Absence:
    kind = rng.random()
    if kind < floor.carried_away:
        gone_s = start_s + float(rng.uniform(*CARRIED_AFTER_S))
        return Absence(start_s, gone_s + float(rng.uniform(*AWAY_S)), gone_s, stands=True)
    drives_on = kind < floor.carried_away + floor.drives_on
    return Absence(start_s, start_s + float(rng.uniform(*floor.silence_s)), None, stands=not drives_on)
