"""The true motion of one robot: along straight legs, with turns on the spot at corners."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, hypot, pi, remainder
from typing import NamedTuple

import numpy as np

from ingest.batch import Floats

STEP_S = 0.1
CORNER_RAD = 0.35
"""A robot stops and turns where its direction changes by more than this."""


class Style(NamedTuple):
    """How a robot drives."""

    limit_mps: float
    """The speed that is allowed, and stated where limits are."""
    pace_mps: float
    """The speed at which it drives."""
    acceleration_mps2: float
    turn_radps: float


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Poses at times `STEP_S` apart, from second 0. Before and after it stands."""

    style: Style
    nodes_m: Floats
    """(k, 2) the points of its way."""
    node_s: tuple[float, ...]
    """(k,) when it is at each, and leaves it if it turns there."""
    node_yaw_rad: tuple[float | None, ...]
    """(k,) the heading to which it turns there. None where it does not turn."""
    begins_s: float
    ends_s: float
    poses: Floats
    """(s, 3) x, y, yaw; the yaw is continuous."""

    def at(self, t_s: Floats) -> Floats:
        """(..., 3) x, y, yaw at times."""
        grid_s = np.arange(len(self.poses)) * STEP_S
        return np.stack([np.interp(t_s, grid_s, column) for column in self.poses.T], axis=-1)

    def motion_at(self, t_s: float) -> tuple[float, float]:
        """Speed along the heading and turn rate."""
        (x_m, y_m, yaw_rad), (to_x_m, to_y_m, to_yaw_rad) = self.at(np.array([t_s, t_s + STEP_S])).tolist()
        return hypot(to_x_m - x_m, to_y_m - y_m) / STEP_S, (to_yaw_rad - yaw_rad) / STEP_S

    def hurried(self, t_s: float, ahead_s: Floats, times: float) -> Floats:
        """(n, 3) where it would be after `ahead_s` (n,) if it drove so many times as fast from now on."""
        waits_s = max(self.begins_s - t_s, 0.0)
        gone_s = np.minimum(ahead_s, waits_s) + np.maximum(ahead_s - waits_s, 0.0) * times
        return self.at(t_s + gone_s)

    def shifted(self, by_s: float) -> "Drive":
        """The same drive, so much later. `by_s` is at least minus `begins_s`."""
        samples = round(by_s / STEP_S)
        poses = np.roll(self.poses, samples, axis=0)
        if samples > 0:
            poses[:samples] = self.poses[0]
        elif samples < 0:
            poses[samples:] = self.poses[-1]
        by_s = samples * STEP_S
        node_s = tuple(t_s + by_s for t_s in self.node_s)
        return Drive(
            self.style, self.nodes_m, node_s, self.node_yaw_rad, self.begins_s + by_s, self.ends_s + by_s, poses
        )


class _Track:
    """The poses of a drive while it grows."""

    def __init__(self, x_m: float, y_m: float, yaw_rad: float, begins_s: float) -> None:
        self.t_s, self.rows = [0.0, begins_s], [(x_m, y_m, yaw_rad)] * 2

    def turn(self, to_rad: float, style: Style) -> None:
        x_m, y_m, yaw_rad = self.rows[-1]
        turn_rad = remainder(to_rad - yaw_rad, 2 * pi)
        self.t_s.append(self.t_s[-1] + max(abs(turn_rad) / style.turn_radps, 1e-3))
        self.rows.append((x_m, y_m, yaw_rad + turn_rad))

    def go(self, x_m: float, y_m: float, style: Style) -> None:
        """Straight on to a point, from standing to standing."""
        from_x_m, from_y_m, yaw_rad = self.rows[-1]
        length_m = hypot(x_m - from_x_m, y_m - from_y_m)
        top_mps = min(style.pace_mps, (length_m * style.acceleration_mps2) ** 0.5)
        gains_s = top_mps / style.acceleration_mps2
        lasts_s = length_m / top_mps + gains_s
        after_s = np.linspace(0.0, lasts_s, max(int(lasts_s / STEP_S), 2))[1:]
        gained, left_s = np.minimum(after_s, gains_s), np.maximum(lasts_s - after_s, 0.0)
        gone_m = np.where(
            left_s < gains_s,
            length_m - style.acceleration_mps2 * left_s**2 / 2,
            style.acceleration_mps2 * gained**2 / 2 + top_mps * np.maximum(after_s - gains_s, 0.0),
        )
        share, start_s = gone_m / length_m, self.t_s[-1]
        self.t_s += (start_s + after_s).tolist()
        self.rows += [
            (from_x_m + part * (x_m - from_x_m), from_y_m + part * (y_m - from_y_m), yaw_rad) for part in share.tolist()
        ]


def driven(
    nodes_m: Sequence[tuple[float, float]],
    style: Style,
    begins_s: float,
    seconds: float,
    yaw_rad: float | None = None,
    last_yaw_rad: float | None = None,
) -> Drive:
    """A drive through `nodes_m`, at least one, from the heading `yaw_rad` to `last_yaw_rad`: by default those of its
    legs."""
    headings = [atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(nodes_m)]
    first_rad = yaw_rad if yaw_rad is not None else headings[0] if headings else 0.0
    track = _Track(*nodes_m[0], first_rad, begins_s)
    turns: list[float | None] = [None] * len(nodes_m)
    stops = [0]
    for number, heading_rad in enumerate(headings):
        turns_here = abs(remainder(heading_rad - track.rows[-1][2], 2 * pi)) > (CORNER_RAD if number else 1e-3)
        if number + 1 == len(headings) or abs(remainder(headings[number + 1] - heading_rad, 2 * pi)) > CORNER_RAD:
            stops.append(number + 1)
        if turns_here:
            turns[number] = heading_rad
            track.turn(heading_rad, style)
        if number + 1 == stops[-1]:
            track.go(*nodes_m[number + 1], style)
    if last_yaw_rad is not None:
        turns[-1] = last_yaw_rad
        track.turn(last_yaw_rad, style)
    t_s = np.arange(round(seconds / STEP_S) + 1) * STEP_S
    rows, grid_s = np.array(track.rows), np.array(track.t_s)
    poses = np.stack([np.interp(t_s, grid_s, column) for column in rows.T], axis=-1)
    node_s = tuple(_passed_s(rows, grid_s, node) for node in nodes_m)
    return Drive(style, np.array(nodes_m), node_s, tuple(turns), begins_s, track.t_s[-1], poses)


def _passed_s(rows: Floats, t_s: Floats, node_m: tuple[float, float]) -> float:
    """When it leaves a node: the last time at which it is nearest."""
    away_m = np.hypot(rows[:, 0] - node_m[0], rows[:, 1] - node_m[1])
    return float(t_s[np.flatnonzero(away_m <= away_m.min() + 1e-6)[-1]])
