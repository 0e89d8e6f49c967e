"""Whether a robot that reports again after a silence is where it was, or where it was believed to be."""

from collections.abc import Sequence
from math import hypot

from deconflict.sweep.geometry.pose import pose_at
from ingest.batch import Batch, Forecasts

BACK_M = 1.0
"""A robot that returns within its own size plus this of its believed place was there."""


def was_there(before: Forecasts, floors: Sequence[str], batch: Batch, row: int) -> bool:
    """Whether the robot of a row has returned where its single forecast `before` put it at that time, or where it was
    last heard. `floors` are those of that forecast."""
    f, knot = batch.forecasts, int(batch.forecasts.start[row])
    x_m, y_m, datum = float(f.x_m[knot]), float(f.y_m[knot]), datum_of(batch.floors, int(f.floor[knot]))
    within_m = BACK_M + hypot(float(f.length_m[row]), float(f.width_m[row]))
    for at_s in (float(f.t_s[knot]), float(before.t_s[0])):
        pose = pose_at(before, at_s)
        if hypot(pose.x_m - x_m, pose.y_m - y_m) <= within_m and datum_of(floors, pose.floor) == datum:
            return True
    return False


def datum_of(floors: Sequence[str], floor: int) -> str:
    """The id of a floor; "" for a floor that is compared with no other."""
    return floors[floor] if floor >= 0 else ""
