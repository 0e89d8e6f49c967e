"""The moments at which two robots were nearest to each other in a log, with the motion around them."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from math import cos, dist, pi, sin
from typing import Any

import numpy as np

from deconflict.foresight.near_misses.near_events import AFTER_S as MEASURED_S
from deconflict.foresight.near_misses.near_events import NearEvent
from deconflict.sweep.shapes.shape_table import SHAPES
from ingest.batch import Floats, Ints, Pair
from ingest.frames.corners import corners_of
from ingest.shapes import Corner, ShapePart
from metrics.truth.recorded_motion import BODIES, RecordedMotion, SampledMotion
from metrics.truth.separations import Separations

KEPT, CANDIDATES = 10, 40
"""Scenes that are listed, and those that are kept until it is known which of them are of one event."""
BEFORE_S, AFTER_S = 6.0, 3.0
APART_S = 3.0
"""Two near moments of one pair belong to one scene if they are closer in time than this, or of one event."""
CIRCLE_CORNERS = 24
"""Of a circle, where it is drawn as a polygon."""
STRETCHES = 5
"""Sampled motions that are kept, enough for the time before and after."""

Outline = list[Corner]
EventOf = Callable[[Pair, float], NearEvent | None]
"""Gives the event of a pair at a time."""


@dataclass(slots=True)
class SceneBody:
    """A robot or a trailer of a scene."""

    track: Floats
    """(k, 3) as the tracks of the scene."""
    outlines_m: list[Outline]
    """Of its parts, in its own frame: corners ahead of its centre, and to its left."""

    def document(self) -> dict[str, Any]:
        outlines = [[[round(x, 3), round(y, 3)] for x, y in outline] for outline in self.outlines_m]
        return {"track": _text(self.track), "outlines_m": outlines}


@dataclass(slots=True)
class NearestScene:
    """Two robots at the moment they were nearest."""

    pair: tuple[str, str]
    at_s: float
    separation_m: float
    closeness: float
    """Distance of the centres divided by the sum of the radii. Orders envelopes that overlap."""
    tracks: list[Floats] = field(default_factory=list)
    """One track for each robot: (k, 3) x, y and yaw at even steps of time. Empty until the motion after it is known."""
    sizes: list[tuple[float, float]] = field(default_factory=list)
    """Length and width of each envelope."""
    bodies: list[list[SceneBody]] = field(default_factory=list)
    """Each robot, with its trailers after it."""
    nearest: int = 0
    """The step at which they were nearest."""
    floor: int = -1
    """Index of the floor on which they were."""
    event: NearEvent | None = None
    """The exact measure of it, once that is known; None if the two kept the clearance."""
    is_measured: bool = False
    x_m: float = 0.0
    y_m: float = 0.0
    """Midpoint between the centres of their nearest bodies at that moment."""

    @property
    def rank(self) -> tuple[float, float, float, tuple[str, str]]:
        return self.separation_m, self.closeness, self.at_s, self.pair

    def measure(self, event: NearEvent | None) -> None:
        """Take over the exact measure."""
        self.is_measured, self.event = True, event
        if event:
            self.at_s, self.separation_m = event.at_s, event.separation_m

    def has(self, at_s: float) -> bool:
        """Whether a near moment of the same pair is part of it."""
        begin_s, end_s = (self.event.began_s, self.event.ended_s) if self.event else (self.at_s, self.at_s)
        return begin_s - APART_S < at_s < end_s + APART_S

    @property
    def began_s(self) -> float:
        """When the two came within the clearance; when they were nearest, if they did not."""
        return self.event.began_s if self.event else self.at_s

    def document(self) -> dict[str, Any]:
        return {
            "robots": list(self.pair),
            "at_s": round(self.at_s, 3),
            "separation_m": round(self.separation_m, 3),
            "x_m": round(self.x_m, 2),
            "y_m": round(self.y_m, 2),
            "nearest": self.nearest,
            "sizes_m": [list(size) for size in self.sizes],
            "tracks": [_text(track) for track in self.tracks],
            "bodies": [[body.document() for body in robot] for robot in self.bodies],
        }


def _text(track: Floats) -> str:
    return ";".join(f"{x:.2f} {y:.2f} {yaw:.3f}" for x, y, yaw in track.tolist())


class NearestScenes:
    """The `CANDIDATES` nearest scenes so far."""

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._held: deque[SampledMotion] = deque(maxlen=STRETCHES)
        self._kept: list[NearestScene] = []

    def add(self, sampled: SampledMotion, near: Separations, motion: RecordedMotion) -> None:
        """Add a sampled motion and the separations of near pairs in it."""
        self._held.append(sampled)
        if len(self._kept) == CANDIDATES:
            near = near.take(np.flatnonzero(near.separation_m <= self._kept[-1].separation_m))
        for row in _nearest_rows(near).tolist():
            pair = motion.pair(int(near.a[row]), int(near.b[row]))
            at_s = int(near.sample[row]) * self._step_s
            self._offer(NearestScene(pair, at_s, float(near.separation_m[row]), float(near.closeness[row])))
        until = sampled.first + sampled.x_m.shape[1]
        self._draw(motion, until - round(AFTER_S / self._step_s))

    def measure(self, until_s: float, event_of: EventOf) -> None:
        """Measure the scenes of which all reports until `MEASURED_S` later are known: those until `until_s`."""
        for scene in self._kept:
            if not scene.is_measured and scene.at_s + MEASURED_S <= until_s:
                scene.measure(event_of(scene.pair, scene.at_s))

    def finish(self, motion: RecordedMotion) -> list[NearestScene]:
        """All scenes, the nearest first, each event once. Call it after the last `measure`."""
        if self._held:
            self._draw(motion, self._held[-1].first + self._held[-1].x_m.shape[1])
        found = {(scene.pair, scene.began_s): scene for scene in sorted(self._kept, key=lambda scene: scene.rank)[::-1]}
        return sorted(found.values(), key=lambda scene: scene.rank)[:KEPT]

    def _offer(self, scene: NearestScene) -> None:
        same = [known for known in self._kept if known.pair == scene.pair and known.has(scene.at_s)]
        if any(known.rank < scene.rank for known in same):
            return
        self._kept = [known for known in self._kept if known not in same]
        self._kept = sorted([*self._kept, scene], key=lambda known: known.rank)[:CANDIDATES]

    def _draw(self, motion: RecordedMotion, until: int) -> None:
        for scene in self._kept:
            middle = round(scene.at_s / self._step_s)
            if not scene.tracks and middle <= until:
                self._track(scene, motion, middle)

    def _track(self, scene: NearestScene, motion: RecordedMotion, middle: int) -> None:
        first, last = middle - round(BEFORE_S / self._step_s), middle + round(AFTER_S / self._step_s)
        robots = motion.slots.find(scene.pair)
        bodies = np.unique(np.concatenate([held.body[np.isin(held.robot, robots)] for held in self._held]))
        is_trailer = bodies % BODIES > 0
        bodies = np.concatenate([BODIES * robots, bodies[is_trailer]])
        parts = [_part(sampled, bodies.tolist(), first, last) for sampled in self._held]
        sample = np.concatenate([samples for samples, _ in parts])
        poses = np.concatenate([pose for _, pose in parts], axis=1)
        there = np.flatnonzero(~np.isnan(poses[:2, :, 0]).any(axis=0))
        there = there[(sample[there] - middle) % 2 == 0]
        if not len(there):
            return
        scene.nearest = int(np.argmin(np.abs(sample[there] - middle)))
        scene.tracks = [poses[row, there, :3] for row in (0, 1)]
        then = poses[:, there[scene.nearest]]
        scene.sizes = [(float(2 * length), float(2 * width)) for length, width in then[:2, 3:5]]
        scene.floor = int(then[0, 5])
        drawn = [
            (int(body) // BODIES, SceneBody(track[:, :3], outlines_of(*map(float, track[scene.nearest, [3, 4, 6]]))))
            for body, track in zip(bodies, poses[:, there], strict=True)
            if not np.isnan(track[:, 0]).any()
        ]
        scene.bodies = [[body for slot, body in drawn if slot == robot] for robot in robots.tolist()]
        scene.x_m, scene.y_m = _midpoint(scene)


def _midpoint(scene: NearestScene) -> tuple[float, float]:
    """The midpoint between those two bodies of a scene whose centres are nearest to each other."""
    a, b = ([body.track[scene.nearest, :2].tolist() for body in robot] for robot in scene.bodies)
    (a_x_m, a_y_m), (b_x_m, b_y_m) = min(product(a, b), key=lambda pair: dist(*pair))
    return (a_x_m + b_x_m) / 2, (a_y_m + b_y_m) / 2


def outlines_of(half_length_m: float, half_width_m: float, shape: float) -> list[Outline]:
    """The outlines of a body in its own frame, circles as polygons. `shape` is a number of `SHAPES`."""
    stated = SHAPES[int(shape)]
    if stated is None:
        return [list(corners_of(0.0, 0.0, 0.0, 2 * half_length_m, 2 * half_width_m))]
    return [_drawn(part) for part in stated.parts]


def _drawn(part: ShapePart) -> Outline:
    if not part.radius_m:
        return list(part.outline_m)
    (x_m, y_m), angles = part.outline_m[0], (2 * pi * at / CIRCLE_CORNERS for at in range(CIRCLE_CORNERS))
    return [(x_m + part.radius_m * cos(angle), y_m + part.radius_m * sin(angle)) for angle in angles]


def _nearest_rows(near: Separations) -> Ints:
    """For each of the `CANDIDATES` nearest pairs, the row at which it was nearest."""
    order = np.lexsort((near.sample, near.closeness, near.separation_m))
    key = near.a[order] * (int(near.b.max(initial=0)) + 1) + near.b[order]
    _, first = np.unique(key, return_index=True)
    return order[np.sort(first)[:CANDIDATES]]


def _part(sampled: SampledMotion, bodies: list[int], first: int, last: int) -> tuple[Ints, Floats]:
    """The samples from `first` to `last`, and (b, k, 7) pose, half sides, floor and shape of b bodies at them."""
    samples = np.arange(max(first, sampled.first), min(last + 1, sampled.first + sampled.x_m.shape[1]))
    poses = np.full((len(bodies), len(samples), 7), np.nan)
    columns = [sampled.x_m, sampled.y_m, sampled.yaw_rad, *sampled.half_m, sampled.floor]
    columns.append(np.zeros_like(sampled.x_m) if sampled.shape is None else sampled.shape)
    for which, body in enumerate(bodies):
        row = int(np.searchsorted(sampled.body, body))
        if row < len(sampled.body) and sampled.body[row] == body:
            poses[which] = np.stack([column[row, samples - sampled.first] for column in columns], axis=1)
    return samples, poses
