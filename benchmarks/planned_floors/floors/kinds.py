"""The kinds of floors that can be made, by name."""

from collections.abc import Callable
from dataclasses import replace

from benchmarks.planned_floors.floors import corridors, grid_floor
from benchmarks.planned_floors.floors.corridors import Corridors
from benchmarks.planned_floors.floors.habits import GridFloor, Habits
from benchmarks.planned_floors.logs.recording import Recording

VENDORS = ("Alder Robotics", "Birch Robotics", "Corvid Robotics")
MadeOf = GridFloor | Corridors


def _blind(kind: str, *vendors: Habits) -> GridFloor:
    return GridFloor(kind, vendors, width=30, height=30)


def _alike(kind: str, **habits: object) -> GridFloor:
    """Three vendors with the same habits."""
    return _blind(kind, *(replace(Habits(vendor, 14), **habits) for vendor in VENDORS))  # type: ignore[arg-type]


def _coordinated(kind: str, tells_order: bool) -> GridFloor:
    return GridFloor(kind, (Habits(VENDORS[0], 60, tells_order=tells_order),), width=32, height=32)


def _mixed(kind: str) -> GridFloor:
    """Vendors that differ in their protective stops and in their reports."""
    return _blind(
        kind,
        Habits(VENDORS[0], 14, protection="stop", tells_waiting=True),
        Habits(VENDORS[1], 14, protection="slow", path_s=5),
        Habits(VENDORS[2], 14, protection="swerve", tells_waiting=True, path_s=10, tells_order=False),
    )


KINDS: dict[str, Callable[[str], MadeOf]] = {
    "blind": _alike,
    "waiting": lambda kind: _alike(kind, tells_waiting=True),
    "slow": lambda kind: _alike(kind, protection="slow"),
    "swerve": lambda kind: _alike(kind, protection="swerve"),
    "mixed": _mixed,
    "orderless": lambda kind: _alike(kind, tells_order=False),
    "paths_5s": lambda kind: _alike(kind, path_s=5),
    "paths_2s": lambda kind: _alike(kind, path_s=2),
    "no_paths": lambda kind: _alike(kind, path_s=0),
    "silent": lambda kind: replace(_alike(kind), silences_per_hour=20.0),
    "coordinated": lambda kind: _coordinated(kind, tells_order=True),
    "coordinated_free": lambda kind: _coordinated(kind, tells_order=False),
    "head_on": Corridors,
    "two_way": Corridors,
}


def made_of(kind: str, seed: int, seconds: float | None = None, report_every_s: float | None = None) -> MadeOf:
    """The parameters of a floor of a kind. Length and report interval are given only if they differ from the kind's."""
    floor = replace(KINDS[kind](kind), seed=seed)
    if seconds is not None:
        floor = replace(floor, seconds=seconds)
    if report_every_s is None:
        return floor
    if isinstance(floor, Corridors):
        return replace(floor, report_every_s=report_every_s)
    return replace(floor, vendors=tuple(replace(habits, report_every_s=report_every_s) for habits in floor.vendors))


def simulate(floor: MadeOf) -> Recording:
    return corridors.simulate(floor) if isinstance(floor, Corridors) else grid_floor.simulate(floor)
