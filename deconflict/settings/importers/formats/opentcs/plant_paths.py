"""The paths of an openTCS plant model as ways, with the curves of their drawing where that fits the points."""

from collections.abc import Iterator, Mapping
from math import dist, inf
from xml.etree.ElementTree import Element

from deconflict.settings.importers.formats.directed_ways import Way
from deconflict.settings.importers.plan import Node, Spot, UnusedParts, unused
from ingest.languages.vda5050.trajectories import polyline
from ingest.languages.vda5050.vda_messages import ControlPoint, Trajectory

USUAL_SCALE = 50.0
"""Millimetres of a step of the drawing's grid, if the file does not say it."""
FIT_M = 0.1
"""A point that is drawn farther from its position is drawn elsewhere."""
FARTHEST = 2.0
"""Control points are no farther from both ends than so many times the length between them."""
SPEEDS = {"maxVelocity": inf, "maxReverseVelocity": 0.0}
"""The speeds forth and back, and what they are if they are missing."""
DRAWN_ONLY = {"ELBOW", "SLANTED"}
"""Connections whose corners the file does not have."""


class PlantPaths:
    """The paths that vehicles may drive."""

    def __init__(self, model: Element, nodes: Mapping[str, Node]) -> None:
        layout = model.find("visualLayout")
        scales = {} if layout is None else layout.attrib
        self._scale_x, self._scale_y = (float(scales.get(key, USUAL_SCALE)) / 1000.0 for key in ("scaleX", "scaleY"))
        self._nodes = nodes
        self._drawn_elsewhere = {p.attrib["name"] for p in model.findall("point") if _is_elsewhere(p, nodes)}
        self._locked = self._speedless = self._lost = self._straightened = self._cornered = 0
        self.ways = {path.attrib["name"]: way for path in model.findall("path") if (way := self._way(path))}
        """By the path's name."""
        self._straightened += sum(
            prop.get("name") == "CONTROL_POINTS" for element in model.iter("modelLayoutElement") for prop in element
        )

    def left_out(self) -> Iterator[UnusedParts]:
        yield from unused(self._locked, "locked path", "vehicles do not use it")
        yield from unused(self._speedless, "path without a speed", "vehicles do not use it", "paths without a speed")
        yield from unused(self._lost, "path", "it leads from or to a point that is not in the file")
        reason = "their drawing does not fit the positions of their points; drawn straight"
        yield from unused(self._straightened, "curve of a path", reason, "curves of paths")
        reason = "the file does not say where they are; drawn straight"
        yield from unused(self._cornered, "path with corners", reason, "paths with corners")

    def _way(self, path: Element) -> Way | None:
        start, end = path.get("sourcePoint", ""), path.get("destinationPoint", "")
        forth, back = (float(path.get(key, usual)) > 0 for key, usual in SPEEDS.items())
        if start not in self._nodes or end not in self._nodes:
            self._lost += 1
        elif path.get("locked") == "true":
            self._locked += 1
        elif not forth and not back:
            self._speedless += 1
        else:
            bends = self._bends(path, start, end)
            return Way(start, end, bends, back) if forth else Way(end, start, bends[::-1])
        return None

    def _bends(self, path: Element, start: str, end: str) -> tuple[Spot, ...]:
        layout = path.find("pathLayout")
        if layout is None:
            return ()
        corners = tuple(self._spot(each) for each in layout.iter("controlPoint"))
        kind = layout.get("connectionType", "")
        if not corners:
            self._cornered += kind in DRAWN_ONLY
            return ()
        a, b = self._nodes[start].at, self._nodes[end].at
        most_m = FARTHEST * dist(a, b)
        fits = not {start, end} & self._drawn_elsewhere
        fits = fits and all(min(dist(a, corner), dist(b, corner)) <= most_m for corner in corners)
        curve = corners if kind == "POLYPATH" else _curve((a, *corners, b))
        if not fits or curve is None:
            self._straightened += 1
            return ()
        return curve

    def _spot(self, point: Element) -> Spot:
        """A point of the drawing, whose y is downwards, in metres."""
        return float(point.attrib["x"]) * self._scale_x, -float(point.attrib["y"]) * self._scale_y


def _curve(spots: tuple[Spot, ...]) -> tuple[Spot, ...] | None:
    """The bends of Bézier curves of the third degree, each of which begins where the one before ends."""
    curves, rest = divmod(len(spots) - 1, 3)
    if rest:
        return None
    knots = [0.0, *(float(row) for row in range(curves + 1) for _ in range(3)), float(curves)]
    points = [ControlPoint(x, y) for x, y in spots]
    curve = polyline(Trajectory(control_points=points, degree=3, knot_vector=knots))
    return curve and curve[1:-1]


def _is_elsewhere(point: Element, nodes: Mapping[str, Node]) -> bool:
    at = _drawn_at(point)
    return at is not None and dist(at, nodes[point.attrib["name"]].at) > FIT_M


def _drawn_at(point: Element) -> Spot | None:
    """Where a point is drawn, in metres; None if that is its position, as from release 7 on."""
    layout = point.find("pointLayout")
    for keys in (("positionX", "positionY"), ("xPosition", "yPosition")):
        if layout is not None and all(key in layout.attrib for key in keys):
            x, y = (float(layout.attrib[key]) / 1000.0 for key in keys)
            return x, y
    return None
