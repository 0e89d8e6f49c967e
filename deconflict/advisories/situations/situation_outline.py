"""Where the advisories of a situation are, as one shape: spots, with thin links between those far apart. Pure."""

from collections.abc import Iterable, Sequence

import shapely

from deconflict.advisories.situations.grouping import Group
from deconflict.advisories.situations.situation import MOST_CORNERS

MARGIN_M, LINK_M = 1.5, 0.2
"""The outline keeps the first distance from the places of the advisories, and the second from a link."""
SPOT_M = 5.0
"""Places that are nearer to each other are of one spot."""
Place = tuple[float, float]


def spots(places: Iterable[Place]) -> list[shapely.Geometry]:
    """The convex hull of the places of each spot, in metres."""
    points = [shapely.Point(place) for place in places]
    around = shapely.union_all([point.buffer(SPOT_M / 2) for point in points])
    parts = shapely.get_parts(around)
    return [shapely.MultiPoint([point for point in points if part.covers(point)]).convex_hull for part in parts]


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
