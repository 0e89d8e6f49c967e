"""A picture of an imported plan, to look at before it is used. Needs matplotlib: `pip install amr-deconflict[plot]`."""

from collections.abc import Iterator
from math import ceil, sqrt
from pathlib import Path

import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from shapely.plotting import plot_polygon

from deconflict.settings.importers.drawing import DrawnSite
from deconflict.settings.importers.plan import ImportedPlan, Level, PlanError, Spot
from deconflict.settings.shared_places import Polygon
from ingest.settings import Datum

COLOURS = {
    "charger": "#2e8b57",
    "parking": "#7a6fb0",
    "dock": "#d9732b",
    "station": "#b8860b",
    "lift": "#2563a8",
    "aisle": "#9aa5b1",
    "crossing": "#c94f7c",
    "door": "#1f9e9e",
}
WALL_COLOUR = "#404040"
LONG_SIDE_IN = 9.0
FOOT_IN = 1.0
"""Height of titles and numbers under a floor."""
LETTER_IN = 0.06
LINE_IN = 0.13
NOTHING = ((0.0, 0.0, 1.0, 1.0),)
"""Bounds to draw if there is nothing at all."""


def save_picture(plan: ImportedPlan, site: DrawnSite, path: Path) -> None:
    """Save one picture of all floors at one scale: places by kind with names, lanes and walls.

    The floors have the same x and y beside and under each other, so that one that lies elsewhere is seen.
    Raises `PlanError`.
    """
    bounds = [each for each in _bounds(plan, site) if each] or NOTHING
    west, south = (min(each[side] for each in bounds) for side in (0, 1))
    wide_m, high_m = (max(each[side + 2] for each in bounds) - low for side, low in ((0, west), (1, south)))
    inches = LONG_SIDE_IN / max(wide_m, high_m)
    columns = ceil(sqrt(len(plan.levels)))
    rows = ceil(len(plan.levels) / columns)
    size_in = max(wide_m * inches, LONG_SIDE_IN / 3), max(high_m * inches, LONG_SIDE_IN / 4) + FOOT_IN
    figure = Figure(figsize=(size_in[0] * columns, size_in[1] * rows), layout="constrained")
    pictures = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat)
    kinds: dict[str, Patch] = {}
    for axes, level, datum in zip(pictures, plan.levels, site.datums, strict=False):
        kinds |= _draw_floor(axes, level, datum, site, inches)
    for axes in pictures[len(plan.levels) :]:
        axes.set_axis_off()
    if kinds:
        figure.legend(kinds.values(), kinds.keys(), fontsize=8, loc="outside lower left", ncols=9, frameon=False)
    try:
        figure.savefig(path, format="png", dpi=100)
    except OSError as error:
        raise PlanError(f"{path} can't be written: {error.strerror}") from error


def _bounds(plan: ImportedPlan, site: DrawnSite) -> Iterator[tuple[float, ...]]:
    for level, datum in zip(plan.levels, site.datums, strict=True):
        outlines = [shapely.Polygon(outline) for _, _, outline in site.drawn_on(datum.id)]
        found = shapely.MultiPoint([node.at for node in level.nodes]).union(shapely.GeometryCollection(outlines))
        yield found.bounds if not found.is_empty else ()


def _draw_floor(axes: Axes, level: Level, datum: Datum, site: DrawnSite, inches: float) -> dict[str, Patch]:
    """Draw one floor, and return a patch of each kind. `inches` is the length of a metre."""
    spots = level.spots()
    for lane in level.lanes:
        _draw_lane(axes, lane.way(spots), is_arrow=not lane.two_way)
    kinds: dict[str, Patch] = {}
    names: list[tuple[str, Spot]] = []
    for kind, name, outline in site.drawn_on(datum.id):
        kinds[kind] = _fill(axes, outline, kind)
        names += [(name, shapely.Polygon(outline).centroid.coords[0])] if name else []
    for name, at, label_at in _apart(names, inches):
        arrow = {"arrowstyle": "-", "color": "#5b6770", "linewidth": 0.4}
        axes.annotate(name, at, label_at, fontsize=7, ha="center", va="center", arrowprops=arrow)
    if not kinds:
        axes.text(0.5, 0.5, "no places", transform=axes.transAxes, ha="center")
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title=datum.name)
    axes.grid(visible=True, linewidth=0.3, alpha=0.5)
    axes.tick_params(labelbottom=True, labelleft=True)
    return kinds


def _apart(names: list[tuple[str, Spot]], inches: float) -> Iterator[tuple[str, Spot, Spot]]:
    """Each name, its place, and where to write it: lower, as long as another is written there."""
    line_m = LINE_IN / inches
    written: list[tuple[float, float, float]] = []
    for name, at in sorted(names, key=lambda each: -each[1][1]):
        half_m, y = LETTER_IN / inches * len(name) / 2, at[1]
        while any(abs(at[0] - x) < half_m + half and abs(y - other) < line_m for x, other, half in written):
            y -= line_m
        written.append((at[0], y, half_m))
        yield name, at, (at[0], y)


def _draw_lane(axes: Axes, way: tuple[Spot, ...], *, is_arrow: bool) -> None:
    axes.plot(*zip(*way, strict=True), color="#5b6770", linewidth=0.8)
    if is_arrow:
        axes.annotate("", way[-1], way[-2], arrowprops={"arrowstyle": "->", "color": "#5b6770", "linewidth": 0.8})


def _fill(axes: Axes, outline: Polygon, kind: str) -> Patch:
    colour = COLOURS.get(kind, WALL_COLOUR)
    patch: Patch = plot_polygon(
        shapely.Polygon(outline), axes, add_points=False, facecolor=colour, edgecolor=colour, alpha=0.5
    )
    return patch
