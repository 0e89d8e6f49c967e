"""Floors on which several vendors drive, second by second, in the floor's frame: simulated ones and recordings."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import DEFAULT
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import BAY_DEPTH_M, HALL, PATTERNS, BayKind, BayRow, FloorPattern, layout_of
from deconflict.simulation.participants import participants
from ingest.batch import Bools, Floats
from ingest.measures.measures import Measures
from ingest.recording.log_reader import LogReader, Received

STEPS = 10
"""Of the simulation, in a second."""
UNEVEN = FloorPattern(
    80.0,
    (6.0, 15.0, 29.0, 38.0, 60.0, 74.0),
    (5.0, 19.0, 27.0, 50.0),
    (
        BayRow(BayKind.RACK, (8.5, 12.5, 31.5, 35.5, 57.5, 71.5), (9.5, 12.5, 31.0, 35.0, 40.0, 45.0)),
        BayRow(BayKind.DOCK, (10.0, 20.0, 33.0, 45.0, 50.0, 66.0), (5.0 - BAY_DEPTH_M,)),
        BayRow(BayKind.CHARGER, (10.0, 33.0, 50.0, 68.0), (19.0 + BAY_DEPTH_M,)),
        BayRow(BayKind.PARKING, (20.0, 24.0, 44.0, 55.0), (50.0 + BAY_DEPTH_M,)),
    ),
)
"""No shift or turn puts it on itself."""
LOOP = FloorPattern(
    80.0,
    (2.0, 78.0),
    (6.0, 14.0),
    (
        BayRow(BayKind.RACK, (8.0, 12.0, 20.0, 28.0, 36.0, 44.0), (14.0 + BAY_DEPTH_M,)),
        BayRow(BayKind.DOCK, (10.0, 24.0, 50.0, 60.0, 66.0), (6.0 - BAY_DEPTH_M,)),
        BayRow(BayKind.CHARGER, (56.0, 62.0), (14.0 + BAY_DEPTH_M,)),
        BayRow(BayKind.PARKING, (16.0, 40.0, 72.0), (6.0 - BAY_DEPTH_M,)),
    ),
)
"""Two long aisles, joined at their ends."""
AISLE_M, AISLE_Y_M, HALF_AISLE_M = HALL.across_m[2], (8.0, 46.0), 1.2
LANES_M, LANES_EVERY_M = 0.15, (11.0, 8.0)


@dataclass(frozen=True, slots=True, eq=False)
class DrivenFloor:
    """What robots drive on one floor: n robots at s seconds."""

    points_m: Floats
    """(s, n, 2) nan where a robot is not on the floor."""
    vendor: list[str]
    """(n,)"""
    width_m: Floats
    """(n,)"""

    def first(self, seconds: int) -> "DrivenFloor":
        return replace(self, points_m=self.points_m[:seconds])

    def only(self, inside: Bools) -> "DrivenFloor":
        """`inside` (s, n): where else, nobody is."""
        return replace(self, points_m=np.where(inside[..., None], self.points_m, np.nan))


def simulated(patterns: tuple[FloorPattern, ...], robots: int, seed: int, seconds: int) -> list[DrivenFloor]:
    """A floor for each pattern."""
    world = World(layout_of(patterns), participants(robots), np.random.default_rng(seed))
    world.spread_start()
    points, floors = np.zeros((seconds, robots, 2)), np.zeros((seconds, robots), np.int64)
    for second in range(seconds):
        for _ in range(STEPS):
            world.step(1 / STEPS)
        points[second], floors[second] = world.locations()[:, :2], world.floor
    vendors = [member.make.vendor.value for member in world.members]
    whole = DrivenFloor(points, vendors, np.array([member.make.body.width_m for member in world.members]))
    return [whole.only(floors == number) for number in range(len(patterns))]


def hall(seed: int, seconds: int) -> list[DrivenFloor]:
    """The hall of the demo, which looks the same from both ends, and its mezzanine."""
    return simulated(PATTERNS, 40, seed, seconds)


def halves(left: DrivenFloor, right: DrivenFloor) -> DrivenFloor:
    """Two equal halls side by side: one vendor only in the left one, the others only in the right one."""
    west = [row for row, vendor in enumerate(left.vendor) if vendor == "Basalt"]
    east = [row for row, vendor in enumerate(right.vendor) if vendor in {"Alder", "Corvid"}]
    points = np.concatenate([left.points_m[:, west], right.points_m[:, east] + (HALL.width_m, 0.0)], axis=1)
    vendors = [left.vendor[row] for row in west] + [right.vendor[row] for row in east]
    return DrivenFloor(points, vendors, np.concatenate([left.width_m[west], right.width_m[east]]))


def one_aisle(floor: DrivenFloor) -> DrivenFloor:
    x_m, y_m = floor.points_m[..., 0], floor.points_m[..., 1]
    with np.errstate(invalid="ignore"):
        near = (np.abs(x_m - AISLE_M) < HALF_AISLE_M) & (y_m > AISLE_Y_M[0]) & (y_m < AISLE_Y_M[1])
    return floor.only(near)


def other_lanes(floor: DrivenFloor, vendor: str, rng: np.random.Generator) -> DrivenFloor:
    """One vendor drives every aisle, and the bays beside it, off the lane of the others by its own distance."""
    points = floor.points_m.copy()
    own = [row for row, name in enumerate(floor.vendor) if name == vendor]
    for axis, every_m in enumerate(LANES_EVERY_M):
        off_m = rng.normal(0.0, LANES_M, 64)
        points[:, own, axis] += off_m[(np.nan_to_num(floor.points_m[:, own, axis]) / every_m).astype(np.int64) % 64]
    return replace(floor, points_m=points)


def recorded(log: Path) -> DrivenFloor:
    """A recording, every second robot of which is taken for another vendor."""
    fleet, cut_s, seen = fleet_of(DEFAULT, Measures()), -np.inf, list[dict[str, tuple[float, float, float]]]()
    for event in LogReader().read([log]):
        if isinstance(event, Received):
            fleet.receive_recorded(event)
            if event.arrival_s - cut_s >= 1.0:
                cut_s = event.arrival_s
                batch = fleet.next_batch(cut_s)
                known, first = batch.forecasts, batch.forecasts.start[:-1]
                places = zip(known.x_m[first], known.y_m[first], known.width_m, strict=True)
                seen.append(dict(zip(batch.robots, places, strict=True)))
    robots = sorted({robot for second in seen for robot in second})
    nowhere = (np.nan, np.nan, np.nan)
    rows = np.array([[second.get(robot, nowhere) for robot in robots] for second in seen])
    vendors = ["Basalt" if number % 2 else "Alder" for number in range(len(robots))]
    return DrivenFloor(rows[..., :2], vendors, np.nanmax(rows[..., 2], axis=0))


def floors_of(seed: int, seconds: int, before: DrivenFloor | None) -> Iterator[tuple[str, DrivenFloor, list[str]]]:
    """Each floor with its name and the vendors of which the map is looked for. `before` is the hall of another seed."""
    robots = ["Alder", "Corvid", "Basalt"]
    ground, mezzanine = hall(seed, seconds)
    yield "hall", ground, robots
    yield "hall, other lanes", other_lanes(ground, "Basalt", np.random.default_rng(seed)), ["Basalt"]
    yield "mezzanine", mezzanine, robots
    yield "one aisle", one_aisle(ground), ["Basalt"]
    if before:
        yield "halves", halves(ground, before), ["Basalt"]
    (uneven,) = simulated((UNEVEN,), 24, seed, seconds)
    yield "uneven", uneven, robots
    yield "uneven, other lanes", other_lanes(uneven, "Basalt", np.random.default_rng(seed)), ["Basalt"]
    yield "loop", simulated((LOOP,), 9, seed, min(seconds, 900))[0], ["Basalt"]
