"""What one robot did by its own reports."""

from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot
from typing import NamedTuple

import numpy as np

from deconflict.foresight.motion_assumptions import JOINED_S
from ingest.batch import Forecasts
from ingest.shapes import Shape, shapes_of

STOOD_M = 0.1
"""A robot that moved no further between two reports stood still."""
LEVEL_M = 0.1
"""A robot whose height changes by no more keeps its height."""
BRIEF_S = 1e-3
"""A robot stays in its place until this long before it is reported elsewhere, and this long after its last report."""


class ReportedPose(NamedTuple):
    """The pose in one report of a robot."""

    t_s: float
    """Time of the pose, seconds since the epoch."""
    x_m: float
    """Centre of the envelope in the floor's frame."""
    y_m: float
    yaw_rad: float
    """Heading, anticlockwise from x."""
    floor: int
    """-1 if the robot is on no floor."""
    bottom_m: float
    """Height of the bottom of its envelope."""
    top_m: float
    """Height of the top of its envelope."""
    length_m: float
    """Of its envelope, along the heading."""
    width_m: float
    """Of its envelope, across the heading."""


@dataclass(slots=True, eq=False)
class RecordedTrack:
    """One robot's reports, ordered by time."""

    name: str = ""
    vendor: str = ""
    reports: list[ReportedPose] = field(default_factory=list)
    shape: Shape | None = None
    """The newest one, with the headings of trailers at the first report; None for a rectangle."""

    def add(self, pose: ReportedPose, shape: Shape | None) -> None:
        """Add a pose, if it is newer than the last, and the shape that the robot has now."""
        if self.reports:
            last = self.reports[-1]
            if pose.t_s <= last.t_s:
                return
            if pose.t_s - last.t_s > JOINED_S and hypot(pose.x_m - last.x_m, pose.y_m - last.y_m) > STOOD_M:
                self.reports.append(last._replace(t_s=last.t_s + BRIEF_S, floor=-1))
        self.reports.append(pose)
        self.shape = _with_first_headings(shape, self.shape)

    def forget_before(self, t_s: float) -> None:
        """Forget reports before a time, once they are as many as those after it."""
        if self.reports[len(self.reports) // 2].t_s < t_s:
            del self.reports[: len(self.reports) // 2]

    def forecasts(self) -> Forecasts:
        """The reports as forecasts, joined linearly: one for each stretch of time in which the robot kept its height
        and size.

        The robot is on no floor before and after each stretch, and from `JOINED_S` after its last report.
        """
        stretches, last = self._stretches(), self.reports[-1]
        knots = [[*stretch, *_stretch_end(stretch[-1], after[0])] for stretch, after in pairwise(stretches)]
        knots.append([*stretches[-1], last._replace(t_s=last.t_s + JOINED_S, floor=-1)])
        t_s, x_m, y_m, yaw_rad, floor, *_ = np.array([knot for stretch in knots for knot in stretch]).T
        n = len(stretches)
        return Forecasts(
            start=np.concatenate([[0], np.cumsum(list(map(len, knots)))]),
            t_s=t_s,
            x_m=x_m,
            y_m=y_m,
            yaw_rad=yaw_rad,
            floor=floor.astype(np.int64),
            length_m=np.array([stretch[0].length_m for stretch in stretches]),
            width_m=np.array([stretch[0].width_m for stretch in stretches]),
            bottom_m=np.array([min(report.bottom_m for report in stretch) for stretch in stretches]),
            top_m=np.array([max(report.top_m for report in stretch) for stretch in stretches]),
            shapes=shapes_of([self.shape] * n),
        )

    def _stretches(self) -> list[list[ReportedPose]]:
        """The reports in runs of one height and size each."""
        stretches: list[list[ReportedPose]] = []
        for report in self.reports:
            if stretches and _is_same_body(stretches[-1][0], report):
                stretches[-1].append(report)
            else:
                stretches.append([report])
        return stretches


def _with_first_headings(shape: Shape | None, before: Shape | None) -> Shape | None:
    if shape and before and len(shape.trailers) == len(before.trailers):
        return shape._replace(trailers=before.trailers)
    return shape


def _stretch_end(last: ReportedPose, after: ReportedPose) -> list[ReportedPose]:
    """The knots that end a stretch: `last` is its last report, `after` the first one of another height or size."""
    gone = after._replace(floor=-1)
    if after.floor != last.floor:
        return [gone]
    brief_s = min(BRIEF_S, (after.t_s - last.t_s) / 2)
    return [after._replace(t_s=after.t_s - brief_s), gone]


def _is_same_body(before: ReportedPose, after: ReportedPose) -> bool:
    heights_m = zip((before.bottom_m, before.top_m), (after.bottom_m, after.top_m), strict=True)
    is_same_size = (before.length_m, before.width_m) == (after.length_m, after.width_m)
    return is_same_size and all(
        before_m == after_m or abs(before_m - after_m) <= LEVEL_M for before_m, after_m in heights_m
    )
