"""How fast robots drive and turn: what they do, as far as they have been seen to; what is usual for their model; else
what they are allowed.

A vendor's robots are observed by kind of way: the speed that is allowed there, and whether it is straight. A median
over a window of motion is not moved by starts and stops, and follows a change of firmware once the window has passed.
"""

from bisect import bisect_left
from collections import OrderedDict, deque
from collections.abc import Sequence
from itertools import accumulate, pairwise
from math import cos, hypot, inf, isfinite, nan, sin
from typing import NamedTuple

import numpy as np

from ingest.batch import Floats
from ingest.fleet.prediction.forecast_model import Knot, Sighting
from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import ASSUMED_MPS, ASSUMED_TURN_RADPS, DRIVES_MPS, TURNS_RADPS
from ingest.frames.way_pieces import nearest_place

SPEEDS_UP_MPS2 = 1.0
"""How quickly robots are assumed to start and to brake."""
OBSERVED_S = 5.0
"""A robot's own speeds count once they were seen for so long; turn rates for `TURNED_S`."""
TURNED_S = 2.0
OWN_S, USUAL_S = 30.0, 240.0
"""Motion over which the speeds of a robot, and of a model, are kept. All robots of a model share the second."""
SPACED_S, APART_S = 0.45, 35.0
"""Sightings nearer in time show more noise than motion, those further apart do not show how a robot drives."""
NOISE_M = 0.2
"""A robot that stands by what it says drives only if it moves further."""
LEAST_SPEED = 1e-3
"""Metres or radians a second. A limit below it is none that a robot can keep."""
BOUNDED = 0.9
"""A robot that drives this share of its limit is bounded by it, and drives faster where more is allowed."""
LEAST_SHARE = 0.2
"""A robot that stops at the end of most of its paths is thought to go on this much of its speed."""
NEARLY = 1.0 - 1e-9
"""So that sums that are equal but for rounding are."""
MOST_MODELS, MOST_KINDS = 1000, 12
UNSLOWED = 0.9
"""A robot that keeps this share of its speed does not brake."""
FULL_TURN = 0.8
"""Of the turn rates between two reports, this part is too small, since the robot turned only some of the time."""
TURN, CORNER, BEYOND, ON_PATH = "turn", "corner", "beyond", "path"
BEYOND_S, BEYOND_COUNTS_S = 3.0, 0.5
"""When a robot is compared with how it was thought to go on beyond its path, and as how much motion that counts."""
FOLLOWED_S, BESIDE_M, LEAST_M = 3.0, 1.0, 0.5
"""When a robot is compared with its path, if it is not further beside it and would have gone at least so far."""
OFTEN, AS_SAID, ALIKE, KEPT_S = 6, 1.4, 1.25, 600.0
"""A robot keeps the times of its paths unless they were off so often by more than the first factor, and half of all
times by nearly the same one, but for the second. A robot that kept them so short a while ago is held up."""
PASSED_M, OVERDUE_S, COUNTS_S = 0.7, 15.0, 5.0
"""A robot passes a place at this distance or less. One that is later than the second passes it no more. A corner counts
as this much motion."""
Kind = float | str
"""The allowed speed in steps of 0.1 m/s, inf if none is stated and negative in a bend; `TURN` for turns on the spot;
`CORNER` for what a corner takes beyond its turn, which is seconds instead of a speed; `BEYOND` for the share of its
speed with which a robot goes on in a straight line beyond the end of its path; `ON_PATH` for how far it drives on its
path as a share of how far it said."""


class Allowance(NamedTuple):
    """What bounds one piece of a way."""

    most: float
    """m/s or rad/s; inf if nothing is stated."""
    kind: Kind


def allowance(most_mps: float, *, is_bend: bool = False) -> Allowance:
    """What bounds a piece of a way on which a speed is allowed; inf if none is stated."""
    kind = round(most_mps, 1) if isfinite(most_mps) else inf
    return Allowance(most_mps, -kind if is_bend else kind)


class ObservedSpeeds:
    """ObservedSpeeds, or turn rates, over the last seconds of motion."""

    def __init__(self, window_s: float, part: float) -> None:
        """`part` of them are smaller than the usual one."""
        self._window_s, self._part, self.seen_s = window_s, part, 0.0
        self._samples: deque[tuple[float, float]] = deque()
        self._usual: float | None = None

    def add(self, lasted_s: float, speed: float) -> None:
        self._samples.append((lasted_s, speed))
        self.seen_s, self._usual = self.seen_s + lasted_s, None
        while self.seen_s - self._samples[0][0] >= self._window_s:
            self.seen_s -= self._samples.popleft()[0]

    @property
    def usual(self) -> float:
        if self._usual is None:
            speeds = sorted((speed, lasted_s) for lasted_s, speed in self._samples)
            lasted_s = list(accumulate(lasts_s for _, lasts_s in speeds))
            self._usual = speeds[bisect_left(lasted_s, self._part * lasted_s[-1] * NEARLY)][0]
        return self._usual

    @property
    def middle(self) -> tuple[float, float]:
        """Between which half of them are."""
        speeds = sorted(speed for _, speed in self._samples)
        return speeds[len(speeds) // 4], speeds[-1 - len(speeds) // 4]


SpeedsByKind = dict[Kind, ObservedSpeeds]


class Pace:
    """How fast one robot was seen to drive and to turn, and others of its model."""

    def __init__(self) -> None:
        self.own: SpeedsByKind = {}
        self.of_model: SpeedsByKind = {}
        """All robots of its model share it."""
        self.kind: Kind | None = None
        """Of the way on which it is; None if nobody says how fast it may drive there, and it plans its own times."""
        self._from: Sighting | None = None
        """The sighting from which it is observed next."""
        self._beyond_corner: tuple[float, float, float] | None = None
        """A place beyond a corner, x and y, and when it would be there if it lost no time by braking and starting."""
        self._beyond_path: tuple[Knot, float, float] | None = None
        """The end of a path, and the direction and the speed with which it was thought to go on there."""
        self._followed: tuple[Sequence[Knot], float, float] | None = None
        """A forecast by its path, and `path_share` and its speed at that time."""
        self._kept_s = -inf
        """When it was last seen to keep the times of a path."""
        self._observed_s = -inf
        """When it was observed last."""
        self._held_back: tuple[float, float] | None = None
        """Since when the times of its path hold it back while it keeps its speed, and that; None if they do not now."""
        self._was_held_back: tuple[float, float] | None = None
        """The same at the sighting before."""

    def begin_anew(self) -> None:
        """It is at another place without having driven there."""
        self._from = self._beyond_corner = self._beyond_path = self._held_back = self._followed = None

    def observe(self, now: Sighting) -> None:
        """Take in where the robot is now."""
        if now.t_s != self._observed_s:
            self._observed_s, self._was_held_back, self._held_back = now.t_s, self._held_back, None
        before = self._from
        if before is None or before.floor != now.floor:
            self._from = now
            return
        lasted_s = now.t_s - before.t_s
        if 0.0 <= lasted_s < SPACED_S:
            return
        self._from = now
        moved_m = hypot(now.x_m - before.x_m, now.y_m - before.y_m)
        if not 0.0 < lasted_s <= APART_S:
            return
        self._pass_corner(before, now)
        self._go_beyond(now)
        is_shown = moved_m > NOISE_M or max(_stated_mps(before), _stated_mps(now)) > DRIVES_MPS
        if is_shown and moved_m > DRIVES_MPS * lasted_s:
            if self.kind is not None:
                self._add(self.kind, lasted_s, moved_m / lasted_s)
            return
        turned_rad = abs(turn_between(before.yaw_rad, now.yaw_rad))
        if turned_rad > TURNS_RADPS * lasted_s:
            self._add(TURN, lasted_s, turned_rad / lasted_s)

    def seen(self, kind: Kind) -> float | None:
        """Its own speed on ways of a kind. None before it was seen for long enough."""
        return _known(self.own.get(kind), kind)

    def usual(self, kind: Kind) -> float | None:
        """The speed of its model on ways of a kind. None if that is not known."""
        return _known(self.of_model.get(kind), kind)

    def keeps_speed(self, here: Sighting) -> bool:
        """Whether the robot, which the times of its path hold back at `here`, as already at the sighting before, has
        not begun to brake since."""
        mps = abs(here.linear_mps or 0.0)
        since_s, most_mps = self._was_held_back or (here.t_s, mps)
        if mps < UNSLOWED * most_mps:
            since_s, most_mps = here.t_s, mps
        self._held_back = since_s, max(mps, most_mps)
        return here.t_s - since_s >= SPACED_S

    def expect_beyond_corner(self, x: float, y: float, t_s: float) -> None:
        """Compare with what is seen when the robot will be beyond a corner, unless it is observed at one already."""
        self._beyond_corner = self._beyond_corner or (x, y, t_s)

    def expect_beyond_path(self, end: Knot, direction_rad: float, mps: float) -> None:
        """Compare with how it goes on beyond the end of its path, unless that of an earlier path is awaited."""
        self._beyond_path = self._beyond_path or (end, direction_rad, mps)

    @property
    def path_share(self) -> float:
        """How fast it drives along its paths as a share of what their times say; 1 for one that keeps them."""
        speeds = self.own.get(ON_PATH)
        keeps_times = self._observed_s - self._kept_s < KEPT_S
        if keeps_times or speeds is None or speeds.seen_s < OFTEN * FOLLOWED_S:
            return 1.0
        low, high = speeds.middle
        return speeds.usual if high < ALIKE * low and (low > AS_SAID or high * AS_SAID < 1.0) else 1.0

    def follow(self, knots: Sequence[Knot] | Floats, now_mps: float | None, *, is_by_path: bool) -> None:
        """Compare where the robot is, the first of the knots, with an earlier forecast by its path, if it has driven
        steadily. They are kept if it drives by the times of its path."""
        (t_s, x, y, _), share_now = knots[0], self.path_share
        if self._followed and t_s >= self._followed[0][0][0] + FOLLOWED_S:
            (earlier, share, mps), self._followed = self._followed, None
            said_m, driven_m = _along(earlier, t_s, x, y)
            lasted_s = t_s - earlier[0][0]
            if said_m >= LEAST_M and UNSLOWED * driven_m <= mps * lasted_s <= driven_m / UNSLOWED:
                share *= driven_m / said_m
                self._add(ON_PATH, min(lasted_s, OWN_S), share)
                self._kept_s = t_s if share < AS_SAID < AS_SAID**2 * share else self._kept_s
        if is_by_path and self._followed is None:
            self._followed = [tuple(knot) for knot in knots], share_now, abs(now_mps or 0.0)

    def _go_beyond(self, now: Sighting) -> None:
        if self._beyond_path is None:
            return
        (t_s, x, y, _), direction_rad, mps = self._beyond_path
        if now.t_s < t_s + BEYOND_S:
            return
        along_m = (now.x_m - x) * cos(direction_rad) + (now.y_m - y) * sin(direction_rad)
        self._add(BEYOND, BEYOND_COUNTS_S, min(max(along_m / (mps * (now.t_s - t_s)), 0.0), 1.0))
        self._beyond_path = None

    def _pass_corner(self, before: Sighting, now: Sighting) -> None:
        if self._beyond_corner is None:
            return
        x, y, expected_s = self._beyond_corner
        dx, dy = now.x_m - before.x_m, now.y_m - before.y_m
        square = dx * dx + dy * dy
        share = ((x - before.x_m) * dx + (y - before.y_m) * dy) / square if square else -1.0
        aside_m = hypot(before.x_m + share * dx - x, before.y_m + share * dy - y)
        if 0.0 <= share <= 1.0 and aside_m <= PASSED_M:
            passed_s = before.t_s + share * (now.t_s - before.t_s)
            self._add(CORNER, COUNTS_S, passed_s - expected_s)
            self._beyond_corner = None
        elif now.t_s > expected_s + OVERDUE_S:
            self._beyond_corner = None

    def _add(self, kind: Kind, lasted_s: float, speed: float) -> None:
        for by_kind, window_s in ((self.own, OWN_S), (self.of_model, USUAL_S)):
            if kind not in by_kind and len(by_kind) >= MOST_KINDS:
                del by_kind[next(iter(by_kind))]
            part = FULL_TURN if kind == TURN else 0.5
            by_kind.setdefault(kind, ObservedSpeeds(window_s, part)).add(lasted_s, speed)


def _stated_mps(sighting: Sighting) -> float:
    return abs(sighting.linear_mps or 0.0)


def _known(speeds: ObservedSpeeds | None, kind: Kind) -> float | None:
    needed_s = TURNED_S if kind == TURN else OBSERVED_S
    return speeds.usual if speeds and speeds.seen_s >= needed_s else None


def _along(knots: Sequence[Knot], t_s: float, x: float, y: float) -> tuple[float, float]:
    """How far from its beginning a forecast puts a robot at a time, and how far along it, or straight on from its end,
    a place is: nan if it is beside that."""
    ways_m = [0.0]
    for before, after in pairwise(knots):
        ways_m.append(ways_m[-1] + hypot(after[1] - before[1], after[2] - before[2]))
    said_m = float(np.interp(t_s, [knot[0] for knot in knots], ways_m))
    away_m, end, point = nearest_place([(knot[1], knot[2]) for knot in knots], x, y)
    (_, from_x, from_y, _), (_, to_x, to_y, _) = knots[end - 1], knots[end]
    driven_m, length_m = hypot(point[0] - from_x, point[1] - from_y), ways_m[end] - ways_m[end - 1]
    if length_m and driven_m >= length_m and end == len(knots) - 1:
        dx, dy = (to_x - from_x) / length_m, (to_y - from_y) / length_m
        driven_m, away_m = (x - from_x) * dx + (y - from_y) * dy, abs((y - to_y) * dx - (x - to_x) * dy)
    return said_m, ways_m[end - 1] + driven_m if away_m <= BESIDE_M else nan


class PaceBook:
    """What was seen of the robots of each model of each vendor."""

    def __init__(self) -> None:
        self._models: OrderedDict[tuple[str, str], SpeedsByKind] = OrderedDict()

    def of_model(self, vendor: str, model: str) -> SpeedsByKind:
        known = self._models.setdefault((vendor, model), {})
        self._models.move_to_end((vendor, model))
        if len(self._models) > MOST_MODELS:
            self._models.popitem(last=False)
        return known


class Paces:
    """How fast one robot will drive and turn."""

    def __init__(self, pace: Pace, here: Sighting) -> None:
        """`here` has its speed and turn rate now."""
        self.pace = pace
        """Of the robot: what was seen of it, and with what that will be compared."""
        mps, radps = abs(here.linear_mps or 0.0), abs(here.turn_radps)
        self._now_mps = mps if mps > DRIVES_MPS else None
        self._now_radps = radps if radps > TURNS_RADPS and self._now_mps is None else None

    def of(self, allowance: Allowance) -> float:
        """Speed, or turn rate, on a piece of its way; at least `LEAST_SPEED`."""
        return max(self._found(allowance), LEAST_SPEED)

    def _found(self, allowance: Allowance) -> float:
        if (own := self.pace.seen(allowance.kind)) is not None:
            return own
        most, kind = allowance
        usual = self.pace.usual(kind)
        if kind == TURN:
            return min(self._now_radps or usual or (most if isfinite(most) else ASSUMED_TURN_RADPS), most)
        if self._now_mps is not None and kind == self.pace.kind:
            return min(self._now_mps, most)
        if usual is not None:
            return min(usual, most)
        if (like_elsewhere := self._like_elsewhere(most)) is not None:
            return like_elsewhere
        return most if isfinite(most) else self._now_mps or ASSUMED_MPS

    @property
    def beyond_share(self) -> float:
        """The share of its speed with which robots of its model usually go on in a straight line beyond their paths."""
        usual = self.pace.usual(BEYOND)
        return 1.0 if usual is None else max(usual, LEAST_SHARE)

    @property
    def corner_s(self) -> float:
        """What a corner takes beyond its turn on the spot, as far as that was seen; less than 0 if it takes less."""
        own = self.pace.seen(CORNER)
        return own if own is not None else self.pace.usual(CORNER) or 0.0

    @property
    def turn_radps(self) -> float:
        """Turn rate on the spot, where none is stated."""
        return self.of(Allowance(inf, TURN))

    def _like_elsewhere(self, most: float) -> float | None:
        """Its speed as on the fastest other ways: that speed, or that share of the limit if the limit bounded it."""
        elsewhere = [
            (abs(kind), speeds.usual)
            for kind, speeds in self.pace.own.items()
            if not isinstance(kind, str) and speeds.seen_s >= OBSERVED_S
        ]
        if not elsewhere:
            return None
        limit_mps, mps = max(elsewhere)
        if isfinite(limit_mps) and isfinite(most) and mps >= BOUNDED * limit_mps:
            return most * min(mps / limit_mps, 1.0)
        return min(mps, most)
