"""Robots that follow each other along one way, and stop now and then: never two in one place."""

import numpy as np

from ingest.batch import Floats
from ingest.frames.driven.driven_places import DrivenPlacesSum
from ingest.frames.driven.map_search import DrivenFrame
from ingest.frames.driven.shared_moments import MomentsSum

ROUND = (
    *((0.0, 0.0), (0.0, 40.0), (7.0, 40.0), (7.0, 6.0), (18.0, 6.0), (18.0, 34.0), (23.0, 34.0), (23.0, 11.0)),
    *((39.0, 11.0), (39.0, 45.0), (47.0, 45.0), (47.0, 17.0), (60.0, 17.0), (60.0, 29.0), (71.0, 29.0), (71.0, -6.0)),
    *((30.0, -6.0), (30.0, 0.0), (0.0, 0.0)),
)
"""A way around a floor that no turn and no shift puts on itself."""
SPEED_MPS, APART_M = 1.5, 2.0


def followed(way: tuple[tuple[float, float], ...], robots: int, seconds: int, seed: int) -> Floats:
    """(seconds, robots, 2) where robots are on a closed way, each second. Neighbours are never nearer than 2 m."""
    rng, corners = np.random.default_rng(seed), np.array(way)
    ends_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at_m, until_s = np.sort(rng.choice(int(ends_m[-1] // 4), robots, replace=False)) * 4.0, np.zeros(robots)
    found = np.empty((seconds, robots, 2))
    for second in range(seconds):
        until_s = np.where(rng.random(robots) < 0.03, second + rng.uniform(3, 30, robots), until_s)
        gaps_m = np.append(at_m[1:], at_m[0] + ends_m[-1]) - at_m
        at_m = at_m + np.clip(np.where(until_s > second, 0.0, gaps_m - APART_M), 0.0, SPEED_MPS)
        found[second] = np.column_stack([np.interp(at_m % ends_m[-1], ends_m, axis) for axis in corners.T])
    return found


def frame_of(points_m: Floats, seed: int, noise_m: float = 0.05) -> DrivenFrame:
    """What is heard of robots (seconds, robots, 2) that are 0.6 m wide."""
    places, moments = DrivenPlacesSum(), MomentsSum()
    heard = points_m + np.random.default_rng(seed).normal(0.0, noise_m, points_m.shape)
    for robot in range(heard.shape[1]):
        for t_s, (x_m, y_m) in enumerate(heard[:, robot].tolist()):
            places.add(str(robot), t_s, x_m, y_m)
            moments.add(str(robot), t_s, x_m, y_m, 0.3)
    return DrivenFrame(places.places(), moments.moments())
