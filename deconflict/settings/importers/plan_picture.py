"""A picture of an imported plan, to look at before it is used. Needs matplotlib: `pip install amr-deconflict[plot]`."""

from pathlib import Path

import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
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


def save_picture(plan: ImportedPlan, site: DrawnSite, path: Path) -> None:
    """Save a picture of the floors side by side: places by kind with names, lanes and walls. Raises `PlanError`."""
    figure = Figure(figsize=(LONG_SIDE_IN * len(plan.levels), LONG_SIDE_IN), layout="constrained")
    pictures = figure.subplots(1, len(plan.levels), squeeze=False)[0]
    for axes, level, datum in zip(pictures, plan.levels, site.datums, strict=True):
        _draw_floor(axes, level, datum, site)
    try:
        figure.savefig(path, format="png", dpi=100)
    except OSError as error:
        raise PlanError(f"{path} can't be written: {error.strerror}") from error


def _draw_floor(axes: Axes, level: Level, datum: Datum, site: DrawnSite) -> None:
    spots = {node.id: node.at for node in level.nodes}
    for lane in level.lanes:
        _draw_lane(axes, (spots[lane.start], *lane.bends, spots[lane.end]), is_arrow=not lane.two_way)
    labelled: set[str] = set()
    for kind, name, outline in site.drawn_on(datum.id):
        _fill(axes, outline, kind, "" if kind in labelled else kind)
        labelled.add(kind)
        if name:
            axes.annotate(name, shapely.Polygon(outline).centroid.coords[0], fontsize=7, ha="center")
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title=datum.name)
    if labelled:
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0.0, -0.06), ncols=4, frameon=False)


def _draw_lane(axes: Axes, way: tuple[Spot, ...], *, is_arrow: bool) -> None:
    axes.plot(*zip(*way, strict=True), color="#5b6770", linewidth=0.8)
    if is_arrow:
        axes.annotate("", way[-1], way[-2], arrowprops={"arrowstyle": "->", "color": "#5b6770", "linewidth": 0.8})


def _fill(axes: Axes, outline: Polygon, kind: str, label: str) -> None:
    colour = COLOURS.get(kind, WALL_COLOUR)
    plot_polygon(
        shapely.Polygon(outline), axes, add_points=False, facecolor=colour, edgecolor=colour, alpha=0.5, label=label
    )
