"""Where the advisories of a situation are, as one shape: spots, with thin links between those far apart. Pure."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from deconflict.advisories.situations.grouping import Group
from deconflict_client.situations import MOST_CORNERS

MARGIN_M, LINK_M = 1.5, 0.2
"""The outline keeps the first distance from the places of the advisories, and the second from a link."""
SPOT_M = 5.0
"""Places that are nearer to each other are of one spot."""
SQUARE_M = SPOT_M / 2**0.5
"""All places in a square of this side are of one spot."""
MOST_LINKED = MOST_CORNERS // 4
"""The outline of more spots mostly has too many corners: each spot has eight, and a link hides few of them."""
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
    if not places:
        return []
    at_m = np.array(places, np.float64)
    _, square = np.unique(np.floor(at_m / SQUARE_M), axis=0, return_inverse=True)
    order = np.argsort(square, kind="stable")
    squares = shapely.multipoints(at_m[order], indices=square[order])
    beside: dict[int, list[int]] = {number: [] for number in range(len(squares))}
    for number, near in shapely.STRtree(squares).query(squares, predicate="dwithin", distance=SPOT_M).T.tolist():
        beside[number].append(near)
    number_of, spots_so_far = dict[int, int](), 0
    for first in square.tolist():
        if first not in number_of:
            reached = [first]
            while reached:
                at = reached.pop()
                if at not in number_of:
                    number_of[at] = spots_so_far
                    reached += beside[at]
            spots_so_far += 1
    return [number_of[each] for each in square.tolist()]


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
