"""A picture of two swept envelopes and their first contact. Needs matplotlib: `pip install amr-deconflict[plot]`."""

from itertools import pairwise
from math import ceil

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from shapely.geometry.base import BaseGeometry
from shapely.ops import nearest_points
from shapely.plotting import plot_polygon

from deconflict.sweep.geometry.pose import Pose, pose_at
from deconflict.sweep.shapes.shape_encounters import bodies, outline
from deconflict.sweep.sweep_once import Conflicts
from ingest.batch import Forecasts

COLOURS = ("#2563a8", "#d9732b")
STEP_S = 0.05
"""Time between two poses of the shaded area."""
OUTLINE_S = 1.0
"""Time between two outlines."""


def draw(
    forecasts: Forecasts,
    found: Conflicts,
    row: int,
    *,
    now_s: float,
    horizon_s: float = 10.0,
    axes: Axes | None = None,
) -> Axes:
    """Draw conflict `row` of `found`, the result of `sweep` for `forecasts`, `now_s` and `horizon_s`.

    The area that each envelope covers on the floor of the contact is shaded, with an outline at each second. Both
    envelopes are bold at first contact. Without `axes` a figure is made. Raises `IndexError` if there is no such
    conflict.
    """
    pair = found.pairs[row].tolist()
    trains = [bodies(forecasts.single(robot)) for robot in pair]
    contact_s = float(found.contact_s[row])
    axes = Figure(figsize=(7.0, 5.0), layout="constrained").add_subplot() if axes is None else axes
    floor = pose_at(trains[0][0], contact_s).floor
    for number, train, colour in zip(pair, trains, COLOURS, strict=True):
        area = shapely.union_all([_swept(body, floor, now_s, horizon_s) for body in train])
        plot_polygon(
            area, axes, add_points=False, facecolor=colour, edgecolor="none", alpha=0.2, label=f"robot {number}"
        )
        for body in train:
            for pose in _poses(body, now_s, horizon_s, OUTLINE_S):
                if pose.floor == floor:
                    _draw_outline(axes, outline(body, pose), colour, 0.6, 0.6)
    touching = [shapely.union_all([outline(body, pose_at(body, contact_s)) for body in train]) for train in trains]
    for area, colour in zip(touching, COLOURS, strict=True):
        _draw_outline(axes, area, colour, 2.0, 1.0)
    _mark_contact(axes, shapely.MultiPoint(nearest_points(*touching)).centroid, contact_s - now_s)
    axes.set(aspect="equal", xlabel="x, m", ylabel="y, m")
    axes.legend(frameon=False)
    return axes


def _draw_outline(axes: Axes, area: BaseGeometry, colour: str, linewidth: float, alpha: float) -> None:
    for part in shapely.get_parts(area):
        axes.plot(*part.exterior.xy, color=colour, linewidth=linewidth, alpha=alpha)


def _mark_contact(axes: Axes, point: shapely.Point, after_s: float) -> None:
    axes.plot(point.x, point.y, marker="o", color="black", linestyle="none", markersize=5)
    axes.annotate(
        f"first contact, {after_s:.2f} s",
        (point.x, point.y),
        xytext=(-60, -70),
        textcoords="offset points",
        arrowprops={"arrowstyle": "-", "linewidth": 0.8},
    )


def _poses(robot: Forecasts, now_s: float, horizon_s: float, step_s: float) -> list[Pose]:
    times = np.linspace(now_s, now_s + horizon_s, ceil(horizon_s / step_s) + 1)
    return [pose_at(robot, t_s) for t_s in times[times >= robot.t_s[0]].tolist()]


def _swept(robot: Forecasts, floor: int, now_s: float, horizon_s: float) -> BaseGeometry:
    poses = _poses(robot, now_s, horizon_s, STEP_S)
    return shapely.union_all(
        [
            outline(robot, pose).union(outline(robot, next_pose)).convex_hull
            for pose, next_pose in pairwise(poses)
            if pose.floor == next_pose.floor == floor
        ]
    )
