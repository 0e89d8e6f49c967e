"""A hall of the demo whose robots stand for each other: its ways, its robots and its site.

Some vendors' robots keep right, others keep left. So robots of two vendors meet face to face in an aisle, and each
stands for the other. By themselves they drive around each other only after a quarter of a minute, as robots of several
vendors do. The aisles have room for that.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import ceil

import numpy as np

from deconflict.settings.shared_places import NamedArea, Obstacle, Polygon, Resource
from deconflict.settings.site import Site
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import BAY_DEPTH_M, BayKind, BayRow, FloorPattern, Layout, layout_of
from deconflict.simulation.participants import ALDER, BASALT, CORVID, Participant, Protection
from deconflict.simulation.vendors.dialects import GROUND_ID

ROBOTS_PER_HALL = 20
PATIENCE_S = (12.0, 18.0)
"""Range of the time after which a robot drives around another by itself."""
MAKES = (
    replace(ALDER, protection=Protection.STOP),
    replace(BASALT, protection=Protection.STOP, lane_m=-BASALT.lane_m),
    replace(CORVID, protection=Protection.STOP, lane_m=-CORVID.lane_m),
)
"""Alder's robots keep right, the others left. All brake, and none swerves by itself."""
WIDTH_M, DEPTH_M, WALL_M = 99.0, 54.0, 0.3
ACROSS_M, ALONG_M = (5.5, 49.5, 93.5), (6.0, 27.0, 48.0)
"""x of the aisles along y, and y of those along x. Between crossings they are straight for 21 and 44 m."""
_BAYS_M = tuple(west_m + 4.0 * rank for west_m in (12.5, 56.5) for rank in range(8))
_CHARGERS_M, _CHARGING_M = _BAYS_M[1::5], ALONG_M[1] + BAY_DEPTH_M
_RACK_SIDES_M = tuple(y + side_m for y in ALONG_M for side_m in (-BAY_DEPTH_M, BAY_DEPTH_M))
PATTERN = FloorPattern(
    WIDTH_M,
    ACROSS_M,
    ALONG_M,
    (
        BayRow(BayKind.RACK, _BAYS_M, _RACK_SIDES_M),
        BayRow(BayKind.CHARGER, _CHARGERS_M, (_CHARGING_M,)),
    ),
)
HALF_AISLE_M, RACK_M, CHARGER_M = 3.2, 4.0, 0.9
"""From the middle of an aisle to where robots may pass, and to a rack, and half of the side of a charger's square."""


def standoff_world(robots: int, seed: int) -> World:
    """The robots, with the vendors in turn, in halls side by side that are enough for their number."""
    members = [Participant(1 + index // len(MAKES), MAKES[index % len(MAKES)]) for index in range(robots)]
    rng = np.random.default_rng(seed)
    return World(_layout(robots), members, rng, half_aisle_m=HALF_AISLE_M, patience_s=PATIENCE_S)


def standoff_site(site: Site, robots: int) -> Site:
    """The demo's site with these halls in place of the warehouse."""
    halls, ground = _halls(robots), site.datums[:1]
    vendors = tuple(
        vendor.model_copy(update={"maps": tuple(each for each in vendor.maps if each.site_datum == GROUND_ID)})
        for vendor in site.vendors
    )
    chargers = [bay.place for bay in _layout(robots).bays if bay.kind is BayKind.CHARGER]
    drawn = {
        "resources": tuple(_charger(number, *place) for number, place in enumerate(chargers, 1)),
        "zones": (),
        "areas": tuple(_areas(halls)),
        "obstacles": tuple(_obstacles(halls)),
    }
    return site.model_copy(update={"name": "Standoff hall", "datums": ground, "vendors": vendors} | drawn)


def _halls(robots: int) -> int:
    return max(1, ceil(robots / ROBOTS_PER_HALL))


def _layout(robots: int) -> Layout:
    return layout_of((PATTERN,), _halls(robots))


def _charger(number: int, x_m: float, y_m: float) -> Resource:
    polygon = _box(x_m - CHARGER_M, y_m - CHARGER_M, x_m + CHARGER_M, y_m + CHARGER_M)
    name = f"Charger {number}"
    return Resource(id=f"charger-{number}", name=name, kind="charger", datum=GROUND_ID, polygon=polygon)


def _areas(halls: int) -> Iterator[NamedArea]:
    for number, x_m in enumerate(_across_m(halls), 1):
        outline_m = _box(x_m - RACK_M, 0.5, x_m + RACK_M, DEPTH_M - 0.5)
        yield NamedArea(name=f"Aisle {number}", floor=GROUND_ID, outline_m=outline_m)
    for name, y_m in zip(("South aisle", "Middle aisle", "North aisle"), ALONG_M, strict=True):
        outline_m = _box(0.5, y_m - RACK_M, halls * WIDTH_M - 0.5, y_m + RACK_M)
        yield NamedArea(name=name, floor=GROUND_ID, outline_m=outline_m)


def _obstacles(halls: int) -> Iterator[Obstacle]:
    """Racks between the aisles, and walls around the halls."""
    blocks = [(xs, ys) for ys in pairwise(ALONG_M) for xs in pairwise(_across_m(halls)) if xs[1] - xs[0] > 3 * RACK_M]
    for number, ((west_m, east_m), (south_m, north_m)) in enumerate(blocks, 1):
        outline_m = _box(west_m + RACK_M, south_m + RACK_M, east_m - RACK_M, north_m - RACK_M)
        yield Obstacle(name=f"Rack {number}", kind="rack", floor=GROUND_ID, outline_m=outline_m)
    east_m, beyond_m = halls * WIDTH_M, halls * WIDTH_M + WALL_M
    for outline_m in (
        _box(-WALL_M, -WALL_M, 0.0, DEPTH_M + WALL_M),
        _box(east_m, -WALL_M, beyond_m, DEPTH_M + WALL_M),
        _box(0.0, -WALL_M, east_m, 0.0),
        _box(0.0, DEPTH_M, east_m, DEPTH_M + WALL_M),
    ):
        yield Obstacle(kind="wall", floor=GROUND_ID, outline_m=outline_m)


def _across_m(halls: int) -> list[float]:
    return [hall * WIDTH_M + x_m for hall in range(halls) for x_m in ACROSS_M]


def _box(west_m: float, south_m: float, east_m: float, north_m: float) -> Polygon:
    return ((west_m, south_m), (east_m, south_m), (east_m, north_m), (west_m, north_m))
