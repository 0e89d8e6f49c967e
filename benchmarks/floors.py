"""Synthetic floors for the benchmarks. Robots do not avoid each other, so there are more conflicts than on real
floors."""

from dataclasses import dataclass, replace

import numpy as np

from ingest.batch import Floats, Forecasts, Ints

NOW_S = 1_790_000_000.0
KNOTS = 11
"""The present pose and ten seconds of path with one point per second, as the standard requires."""


@dataclass(frozen=True)
class World:
    """n robots that keep their first speed and turn rate. Arrays are (n,)."""

    x: Floats
    y: Floats
    yaw: Floats
    speed: Floats
    turn: Floats
    phase: Floats
    """When within a second each robot reports."""
    length: Floats
    width: Floats

    def pose(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Poses (n, k) at `t` (n, k), seconds since the start: on a circle or a straight line."""
        yaw = self.yaw[:, None] + self.turn[:, None] * t
        turning = np.where(self.turn == 0, 1.0, self.turn)[:, None]
        chord = np.where(self.turn[:, None] == 0, t, 2 * np.sin(self.turn[:, None] * t / 2) / turning)
        way, middle = self.speed[:, None] * chord, (self.yaw[:, None] + yaw) / 2
        return self.x[:, None] + way * np.cos(middle), self.y[:, None] + way * np.sin(middle), yaw

    def forecasts(self, at_s: float) -> Forecasts:
        """The newest reports at `at_s`, seconds since the start: a present pose and ten points of path."""
        n = len(self.x)
        reported = np.floor(at_s - self.phase) + self.phase
        t = reported[:, None] + np.arange(KNOTS, dtype=np.float64)
        x, y, yaw = self.pose(t)
        return Forecasts(
            start=np.arange(n + 1) * KNOTS,
            t_s=(NOW_S + t).ravel(),
            x_m=x.ravel(),
            y_m=y.ravel(),
            yaw_rad=yaw.ravel(),
            floor=np.zeros(n * KNOTS, np.int64),
            length_m=self.length,
            width_m=self.width,
            bottom_m=np.full(n, -np.inf),
            top_m=np.full(n, np.inf),
        )

    def forecast_poses(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Poses (n, k) at `t` (k,) by the forecasts of second 0, which are straight between points."""
        reported = (np.floor(-self.phase) + self.phase)[:, None]
        before = np.minimum(np.floor(t - reported), KNOTS - 2)
        share = t - reported - before
        here, there = self.pose(reported + before), self.pose(reported + before + 1)
        x, y, yaw = (a + np.minimum(share, 1.0) * (b - a) for a, b in zip(here, there, strict=True))
        return x, y, yaw

    def due(self, from_s: float, to_s: float) -> Ints:
        """The robots that report after `from_s`, up to `to_s`."""
        return np.flatnonzero(np.floor(to_s - self.phase) > np.floor(from_s - self.phase))


def crowd(robots: int, area_m2: float, *, moving: float = 0.8, seed: int = 1) -> World:
    """Robots at random on a square with `area_m2` for each. A share `moving` of them drives; a third of these turn."""
    rng = np.random.default_rng(seed)
    side = np.sqrt(robots * area_m2)
    under_way = rng.random(robots) < moving
    return World(
        x=rng.uniform(0, side, robots),
        y=rng.uniform(0, side, robots),
        yaw=rng.uniform(-np.pi, np.pi, robots),
        speed=np.where(under_way, rng.uniform(0.3, 1.8, robots), 0.0),
        turn=np.where(under_way & (rng.random(robots) < 1 / 3), rng.normal(0, 0.2, robots), 0.0),
        phase=rng.uniform(0, 1, robots),
        length=rng.uniform(0.6, 1.4, robots),
        width=rng.uniform(0.5, 1.0, robots),
    )


def lanes(robots: int, area_m2: float, *, seed: int = 1) -> World:
    """Robots in parallel lanes with one speed for each lane. A few stand. Conflicts are rare, as on a real site."""
    made = crowd(robots, area_m2, seed=seed)
    rng = np.random.default_rng([seed, 1])
    gap_m = 2.0
    side = np.sqrt(robots * area_m2)
    count = int(side / gap_m)
    lane = np.arange(robots) % count
    in_lane = robots // count + 1
    place = (np.arange(robots) // count + rng.uniform(0.0, 0.3, robots)) * side / in_lane
    speed: Floats = rng.uniform(0.3, 1.8, count)[lane]
    return replace(
        made,
        x=place,
        y=lane.astype(np.float64) * gap_m,
        yaw=np.zeros(robots),
        speed=np.where(rng.random(robots) < 0.02, 0.0, speed),
        turn=np.zeros(robots),
    )
