"""Where the advisories of a situation are, as one shape: spots, with thin links between those far apart. Pure."""

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from deconflict.advisories.situations.grouping import Group
from deconflict.advisories.situations.situation import MOST_CORNERS
from deconflict.sweep.geometry.islands import islands_of
from ingest.batch import Ints

MARGIN_M, LINK_M = 1.5, 0.2
"""The outline keeps the first distance from the places of the advisories, and the second from a link."""
SPOT_M = 5.0
"""Places that are nearer to each other are of one spot."""
Place = tuple[float, float]


def spots(places: Iterable[Place]) -> list[shapely.Geometry]:
    """The convex hull of the places of each spot, in metres."""
    spot, points = _spot_of(places)
    by_spot = np.argsort(spot, kind="stable")
    return list(shapely.convex_hull(shapely.multipoints(points[by_spot], indices=spot[by_spot])))


def count_spots(places: Iterable[Place]) -> int:
    """How many spots the places are of."""
    spot, _ = _spot_of(places)
    return int(spot.max(initial=-1)) + 1


def _spot_of(places: Iterable[Place]) -> tuple[Ints, NDArray[np.object_]]:
    """(n,) the number of the spot of each place, and (n,) the points. A point is near itself, so it is of a spot."""
    points = shapely.points(np.array([*places], np.float64).reshape(-1, 2))
    near, other = shapely.STRtree(points).query(points, "dwithin", SPOT_M)
    _, spot = islands_of(near, other, len(points))
    return spot, points


def outline(group: Group) -> tuple[Place, ...]:
    """Corners of the area around the places of its advisories, in metres; empty without a place."""
    if not group.datum:
        return ()
    places = [(member.x_m, member.y_m) for member in group.members.values()]
    whole = shapely.MultiPoint(places)
    shapes = (_linked(spots(places)), _around(whole.convex_hull), _around(whole.envelope))
    area = next((shape for shape in shapes if len(shape.exterior.coords) <= MOST_CORNERS + 1), shapes[-1])
    return tuple((round(x, 2), round(y, 2)) for x, y in area.exterior.coords[:-1])


def _around(shape: shapely.Geometry) -> shapely.Polygon:
    return shape.buffer(MARGIN_M, quad_segs=2)


def _linked(hulls: Sequence[shapely.Geometry]) -> shapely.Polygon:
    """The areas around all spots as one polygon: each is linked to the nearest of those before it."""
    whole = _around(hulls[0])
    left = [*hulls[1:]]
    while left:
        nearest = min(left, key=whole.distance)
        left.remove(nearest)
        area = _around(nearest)
        link = shapely.shortest_line(whole, area).buffer(LINK_M, cap_style="square")
        whole = shapely.union_all([whole, link, area])
    return whole
