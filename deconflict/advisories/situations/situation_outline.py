"""Where the advisories of a situation are, as one shape: spots, with thin links between those far apart. Pure."""

from collections.abc import Iterator, Sequence
from itertools import product
from math import dist

import numpy as np
import shapely

from deconflict.advisories.situations.grouping import Group
from deconflict_client.situations import MOST_CORNERS

MARGIN_M, LINK_M = 1.5, 0.2
"""The outline keeps the first distance from the places of the advisories, and the second from a link."""
SPOT_M = 5.0
"""Places that are nearer to each other are of one spot."""
MOST_LINKED = MOST_CORNERS // 4
"""The outline of more spots has too many corners: each spot has eight, and a link hides few of them."""
Place = tuple[float, float]


def spots(places: Sequence[Place]) -> list[shapely.Geometry]:
    """The convex hull of the places of each spot, in metres: that of a line through them, which is made faster than the
    points. It passes each place twice, since a line has two points at least."""
    at_m, spot = np.array(places, np.float64), np.array(spot_numbers(places))
    twice = np.repeat(np.argsort(spot, kind="stable"), 2)
    return list(shapely.convex_hull(shapely.linestrings(at_m[twice], indices=spot[twice])))


def count_spots(places: Sequence[Place]) -> int:
    """How many spots the places are of."""
    return max(spot_numbers(places), default=-1) + 1


def spot_numbers(places: Sequence[Place]) -> list[int]:
    """The number of the spot of each place, from 0 by their first places."""
    left: dict[tuple[int, int], list[int]] = {}
    for index, (x_m, y_m) in enumerate(places):
        left.setdefault((int(x_m // SPOT_M), int(y_m // SPOT_M)), []).append(index)
    number, spots_so_far = [-1] * len(places), 0
    for first in range(len(places)):
        if number[first] < 0:
            reached = [first]
            while reached:
                near = _taken_near(places, places[reached.pop()], left)
                reached += near
                for index in near:
                    number[index] = spots_so_far
            spots_so_far += 1
    return number


def _taken_near(places: Sequence[Place], at_m: Place, left: dict[tuple[int, int], list[int]]) -> list[int]:
    """Indices of the places near a point, which are taken out of those that are `left`, by square of `SPOT_M`."""
    column, row = (int(value_m // SPOT_M) for value_m in at_m)
    taken: list[int] = []
    for square in product(range(column - 1, column + 2), range(row - 1, row + 2)):
        stays: list[int] = []
        for index in left.pop(square, ()):
            (taken if dist(at_m, places[index]) <= SPOT_M else stays).append(index)
        if stays:
            left[square] = stays
    return taken


def outline(group: Group) -> tuple[Place, ...]:
    """Corners of the area around the places of its advisories, in metres; empty without a place."""
    if not group.datum:
        return ()
    places = sorted((member.x_m, member.y_m) for member in group.members.values())
    rings = (shapely.get_exterior_ring(area) for area in _areas(places))
    ring = next(ring for ring in rings if shapely.get_num_coordinates(ring) <= MOST_CORNERS + 1)
    return tuple((x_m, y_m) for x_m, y_m in shapely.get_coordinates(ring)[:-1].round(2).tolist())


def _areas(places: Sequence[Place]) -> Iterator[shapely.Polygon]:
    """Areas around the places, the closest to them first. Only the last one never has too many corners."""
    if len(hulls := spots(places)) <= MOST_LINKED:
        yield _linked(hulls)
    yield _around(shapely.multipoints(places).convex_hull)
    yield _around(shapely.multipoints(places).envelope)


def _around(shape: shapely.Geometry) -> shapely.Polygon:
    return shapely.buffer(shape, MARGIN_M, quad_segs=2)


def _linked(hulls: Sequence[shapely.Geometry]) -> shapely.Polygon:
    """The areas around all spots as one polygon: each is linked to the nearest of those before it."""
    whole = _around(hulls[0])
    left = [*hulls[1:]]
    while left:
        nearest = min(left, key=whole.distance)
        left.remove(nearest)
        area = _around(nearest)
        link = shapely.buffer(shapely.shortest_line(whole, area), LINK_M, cap_style="square")
        whole = shapely.union_all([whole, link, area])
    return whole
