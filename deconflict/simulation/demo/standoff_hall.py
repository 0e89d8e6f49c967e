"""A hall of the demo whose robots stand for each other: its aisles, its robots and its site.

In each aisle robots of two vendors shuttle between their docks at both ends, each on a straight way of its own. The two
ways cross in the middle, and neither robot knows the plan of the other. So they meet face to face there, and each
stands for the other. By themselves they drive around each other only after a quarter of a minute, as robots of several
vendors do. The aisles have room for that.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import ceil

import numpy as np

from deconflict.settings.shared_places import NamedArea, Obstacle, Polygon
from deconflict.settings.site import Site
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import GROUND, Bay, BayKind, Layout
from deconflict.simulation.participants import ALDER, BASALT, CORVID, Participant, Protection
from deconflict.simulation.trips import Trips
from deconflict.simulation.vendors.dialects import GROUND_ID
from ingest.batch import Ints

PATIENCE_S = (12.0, 18.0)
"""Range of the time after which a robot drives around another by itself."""
STAYS_S = (4.0, 12.0)
"""How long a robot stays in a dock."""
MAKES = tuple(replace(make, protection=Protection.STOP, lane_m=0.0) for make in (ALDER, BASALT, CORVID))
"""All brake, and none swerves by itself."""
WIDTH_M, DEPTH_M, WALL_M = 99.0, 54.0, 0.3
ALONG_M = tuple(4.5 + 5.0 * rank for rank in range(10))
"""y of the aisles."""
ENDS_M = ((3.0, 48.0), (51.0, 96.0))
"""x of the docks at the west and east end of the aisles in each half of a hall."""
DOCK_M = 0.85
"""From the middle of an aisle to each of the two docks at an end."""
HALF_AISLE_M, RACK_TO_M = 2.3, 2.7
"""From the middle of an aisle to the rack north of it, and to the aisle beyond."""
PER_AISLE = 2
ROBOTS_PER_HALL = PER_AISLE * len(ALONG_M) * len(ENDS_M)


class Shuttles(Trips):
    """Each robot has two docks, one after the other in the layout, and drives from one to the other."""

    def _starts(self, bays: Ints) -> tuple[Ints, Ints]:
        robots = len(self._person)
        return bays[:0], 2 * np.arange(robots) + np.arange(robots) % PER_AISLE

    def choose(self, robot: int, *, needs_charge: bool) -> Bay | None:  # noqa: ARG002 - nobody charges here
        self.goal[robot] = self.bay[robot] ^ 1
        return self.layout.bays[int(self.goal[robot])]


class StandoffWorld(World):
    """The robots of the hall, with the vendors in turn. More than fit in get further halls beside it."""

    def __init__(self, robots: int, seed: int) -> None:
        members = [Participant(1 + index // len(MAKES), MAKES[index % len(MAKES)]) for index in range(robots)]
        rng, layout = np.random.default_rng(seed), _layout(robots)
        super().__init__(layout, members, rng, trips=Shuttles, half_aisle_m=HALF_AISLE_M, patience_s=PATIENCE_S)
        self.battery_pct = rng.uniform(70.0, 98.0, robots)

    def _arrived(self, robot: int) -> float:
        self.trips.arrive(robot)
        return float(self._rng.uniform(*STAYS_S))


def standoff_site(site: Site, robots: int) -> Site:
    """The demo's site with these halls in place of the warehouse."""
    halls = _halls(robots)
    vendors = tuple(
        vendor.model_copy(update={"maps": tuple(each for each in vendor.maps if each.site_datum == GROUND_ID)})
        for vendor in site.vendors
        if vendor.name in [make.vendor for make in MAKES]
    )
    drawn = {"areas": tuple(_areas(halls)), "obstacles": tuple(_obstacles(halls))}
    places = {"name": "Standoff hall", "datums": site.datums[:1], "resources": (), "zones": ()}
    return site.model_copy(update={"vendors": vendors} | places | drawn)


def _halls(robots: int) -> int:
    return max(1, ceil(robots / ROBOTS_PER_HALL))


def _aisles(halls: int) -> list[tuple[float, float, float]]:
    """West and east end, and y, of each aisle."""
    ends = [(hall * WIDTH_M + west_m, hall * WIDTH_M + east_m) for hall in range(halls) for west_m, east_m in ENDS_M]
    return [(west_m, east_m, y_m) for west_m, east_m in ends for y_m in ALONG_M]


def _layout(robots: int) -> Layout:
    """Two docks and the way between them for each robot, with two robots in each aisle."""
    layout, aisles, bays = Layout([], [], []), _aisles(_halls(robots)), []
    for robot in range(robots):
        west_m, east_m, y_m = aisles[robot // PER_AISLE]
        beside_m = DOCK_M if robot % PER_AISLE else -DOCK_M
        docks = layout.add(GROUND, (west_m, y_m + beside_m)), layout.add(GROUND, (east_m, y_m - beside_m))
        layout.join(*docks, docks[0])
        bays += [Bay(dock, GROUND, layout.places[dock], BayKind.RACK) for dock in docks]
    layout.bays, layout.bay_nodes = tuple(bays), frozenset(bay.node for bay in bays)
    return layout


def _areas(halls: int) -> Iterator[NamedArea]:
    for number, (west_m, east_m, y_m) in enumerate(_aisles(halls), 1):
        outline_m = _box(west_m, y_m - HALF_AISLE_M, east_m, y_m + HALF_AISLE_M)
        yield NamedArea(name=f"Aisle {number}", floor=GROUND_ID, outline_m=outline_m)


def _obstacles(halls: int) -> Iterator[Obstacle]:
    """A rack north of each aisle but the last of a half, and walls around the halls."""
    for number, (west_m, east_m, y_m) in enumerate(_aisles(halls), 1):
        if y_m < ALONG_M[-1]:
            outline_m = _box(west_m, y_m + HALF_AISLE_M, east_m, y_m + RACK_TO_M)
            yield Obstacle(name=f"Rack {number}", kind="rack", floor=GROUND_ID, outline_m=outline_m)
    east_m, beyond_m = halls * WIDTH_M, halls * WIDTH_M + WALL_M
    for outline_m in (
        _box(-WALL_M, -WALL_M, 0.0, DEPTH_M + WALL_M),
        _box(east_m, -WALL_M, beyond_m, DEPTH_M + WALL_M),
        _box(0.0, -WALL_M, east_m, 0.0),
        _box(0.0, DEPTH_M, east_m, DEPTH_M + WALL_M),
    ):
        yield Obstacle(kind="wall", floor=GROUND_ID, outline_m=outline_m)


def _box(west_m: float, south_m: float, east_m: float, north_m: float) -> Polygon:
    return ((west_m, south_m), (east_m, south_m), (east_m, north_m), (west_m, north_m))
