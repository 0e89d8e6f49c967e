"""Robots on errands: from place to place in straight lines, each waiting or going elsewhere first where it is told to.

A robot tells its plan as it then is, waits included. It leaves a place only once the next one is free, and drives on
only while the floor just ahead of it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan2, copysign, cos, hypot, inf, pi, sin

import numpy as np
import shapely

from deconflict.simulation.cast import Member
from deconflict.simulation.fleet_plans import Plan
from deconflict.simulation.floor_layout import GROUND
from deconflict.simulation.robot_state import Robot

PACE_MPS = 1.0
TURN_RADPS = 1.5
SLACK_M, SLACK_RAD = 1e-6, 0.01
STEP_S = 0.1
GAP_M = 0.2
"""A robot stops where another one is nearer than this ahead of it: less than the demo's clearance."""


@dataclass(frozen=True, slots=True)
class Visit:
    """Somewhere that a robot goes to, and how long it stays; where it stays for no time it passes."""

    x_m: float
    y_m: float
    place: str = ""
    """Id of a resource."""
    stay_s: float = 0.0
    state: str = "waitingExternalEvent"
    """What it says while it is there."""


@dataclass(frozen=True, slots=True)
class Knot:
    """Where a robot will be so long from now; `visit` where it has just come to the place of one."""

    after_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    visit: Visit | None = None


class Errand:
    """One robot. Time goes on only by `step`."""

    def __init__(self, member: Member, start: tuple[float, float], visits: Sequence[Visit], *, deaf: bool = False):
        """It stands at `start`, and heads for its first visit. One that is `deaf` does nothing that it is told."""
        self.member, self.visits, self.deaf = member, list(visits), deaf
        self.x_m, self.y_m = start
        self.yaw_rad = self._heading_rad(self.visits[0])
        self.t_s = 0.0
        self._stay_s, self._state = 0.0, "navigating"
        self._hold_s = 0.0
        self.at = ""
        """Id of the place that it is at."""
        self.due_s = self._timetable()[-1].after_s
        """When it means to be through, as long as nothing is in its way."""
        self.through_s: float | None = None
        """When it was."""
        self.told_s = -inf
        """When it last changed its plan because it was told to."""

    def step(self, dt_s: float, *, free: bool) -> None:
        """Let `dt_s` pass; without `free` it can't drive on."""
        left_s = dt_s
        while left_s > 1e-9:
            used_s = self._act(left_s, free)
            left_s -= used_s
            self.t_s += used_s

    def _act(self, most_s: float, free: bool) -> float:
        """Do the next thing, for at most so long; how long it took."""
        if self._hold_s + self._stay_s > 0:
            return self._stand(most_s)
        if not self.visits:
            return self._rest(most_s)
        self._state, visit = "navigating", self.visits[0]
        left_m = hypot(visit.x_m - self.x_m, visit.y_m - self.y_m)
        if left_m <= SLACK_M:
            self.visits.pop(0)
            self._stay_s, self._state, self.at = visit.stay_s, visit.state, visit.place
            return 0.0
        turn_rad = _turn(self.yaw_rad, self._heading_rad(visit))
        if abs(turn_rad) > SLACK_RAD:
            used_s = min(abs(turn_rad) / TURN_RADPS, most_s)
            self.yaw_rad += copysign(used_s * TURN_RADPS, turn_rad)
            return used_s
        return self._drive(visit, left_m, most_s) if free else most_s

    def _drive(self, visit: Visit, left_m: float, most_s: float) -> float:
        self.at = ""
        used_s = min(left_m / PACE_MPS, most_s)
        share = used_s * PACE_MPS / left_m
        self.x_m += share * (visit.x_m - self.x_m)
        self.y_m += share * (visit.y_m - self.y_m)
        return used_s

    def _stand(self, most_s: float) -> float:
        held_s = min(self._hold_s, most_s)
        stayed_s = min(self._stay_s, most_s - held_s)
        self._hold_s, self._stay_s = self._hold_s - held_s, self._stay_s - stayed_s
        return held_s + stayed_s

    def _rest(self, most_s: float) -> float:
        if self.through_s is None:
            self.through_s = self.t_s
        self._state = "idle"
        return most_s

    @property
    def drives(self) -> bool:
        """Whether it would drive on now."""
        return bool(self.visits) and self._hold_s <= 0 and self._stay_s <= 0

    @property
    def late_s(self) -> float:
        """How much later it was through, or will be, than it meant to at first."""
        ends_s = self.t_s + self._timetable()[-1].after_s if self.through_s is None else self.through_s
        return ends_s - self.due_s

    def wait(self, more_s: float) -> None:
        """Stand so much longer before going on; if less than 0, so much shorter than it was told to."""
        if not self.deaf:
            self._hold_s = max(self._hold_s + more_s, 0.0)
            self.told_s = self.t_s

    def go(self, visits: Sequence[Visit]) -> None:
        """Go to these first."""
        if not self.deaf:
            self.visits[:0] = visits
            self.told_s = self.t_s

    def go_instead(self, visit: Visit) -> None:
        """Go there instead of to the next place, for as long."""
        if not self.deaf:
            row = next(row for row, one in enumerate(self.visits) if one.place)
            self.visits[row] = replace(self.visits[row], x_m=visit.x_m, y_m=visit.y_m, place=visit.place)
            self.told_s = self.t_s

    def comes_s(self, place: str) -> float | None:
        """When it will be at a place; None where it does not go there."""
        return next(
            (self.t_s + knot.after_s for knot in self._timetable() if knot.visit and knot.visit.place == place), None
        )

    def enters_s(self, outline: shapely.Polygon) -> float | None:
        """When its front comes into an outline that it drives at; None where it does not come there."""
        knots, body = self._timetable(), self.member.make.body
        after_s = np.arange(0.0, knots[-1].after_s + STEP_S, STEP_S)
        times_s = [one.after_s for one in knots]
        x_m, y_m = (np.interp(after_s, times_s, [getattr(one, name) for one in knots]) for name in ("x_m", "y_m"))
        apart_m = shapely.distance(shapely.points(x_m, y_m), outline)
        touching = np.flatnonzero(apart_m <= body.ahead_m + body.length_m / 2)
        return self.t_s + float(after_s[touching[0]]) if len(touching) else None

    def body(self, ahead_m: float = 0.0) -> shapely.Polygon:
        """Its envelope, lengthened ahead."""
        one = self.member.make.body
        back, front = one.ahead_m - one.length_m / 2, one.ahead_m + one.length_m / 2 + ahead_m
        c, s, wide = cos(self.yaw_rad), sin(self.yaw_rad), one.width_m / 2
        corners = [(back, -wide), (front, -wide), (front, wide), (back, wide)]
        return shapely.Polygon([(self.x_m + c * a - s * b, self.y_m + s * a + c * b) for a, b in corners])

    def robot(self) -> Robot:
        """All that its vendor's dialect can tell."""
        knots = self._timetable()
        moving = self.drives
        return Robot(
            member=self.member,
            t_s=self.t_s,
            floor=GROUND,
            x_m=self.x_m,
            y_m=self.y_m,
            yaw_rad=self.yaw_rad,
            linear_mps=PACE_MPS if moving else 0.0,
            turn_radps=0.0,
            state=self._state,
            battery_pct=50.0,
            load_pct=0.0,
            errors=(),
            plan=Plan(
                np.array([one.after_s for one in knots]),
                np.array([(one.x_m, one.y_m, one.yaw_rad) for one in knots]),
                np.full(len(knots), GROUND),
            ),
            destinations=tuple(
                (one.after_s, GROUND, one.x_m, one.y_m, one.yaw_rad)
                for one in knots
                if one.visit and (one.visit.place or one.visit is self.visits[-1])
            ),
        )

    def _timetable(self) -> list[Knot]:
        """Where it will be from now on, if nothing is in its way; the last one for ever."""
        x_m, y_m, yaw_rad = self.x_m, self.y_m, self.yaw_rad
        after_s = self._hold_s + self._stay_s
        knots = [Knot(0.0, x_m, y_m, yaw_rad)]
        if after_s > 0:
            knots.append(Knot(after_s, x_m, y_m, yaw_rad))
        for visit in self.visits:
            left_m = hypot(visit.x_m - x_m, visit.y_m - y_m)
            if left_m > SLACK_M:
                turn_rad = _turn(yaw_rad, atan2(visit.y_m - y_m, visit.x_m - x_m))
                if abs(turn_rad) > SLACK_RAD:
                    after_s, yaw_rad = after_s + abs(turn_rad) / TURN_RADPS, yaw_rad + turn_rad
                    knots.append(Knot(after_s, x_m, y_m, yaw_rad))
                after_s += left_m / PACE_MPS
            x_m, y_m = visit.x_m, visit.y_m
            knots.append(Knot(after_s, x_m, y_m, yaw_rad, visit))
            if visit.stay_s > 0:
                after_s += visit.stay_s
                knots.append(Knot(after_s, x_m, y_m, yaw_rad))
        return knots

    def _heading_rad(self, visit: Visit) -> float:
        return atan2(visit.y_m - self.y_m, visit.x_m - self.x_m)


def _turn(from_rad: float, to_rad: float) -> float:
    """The shorter way round."""
    return (to_rad - from_rad + pi) % (2 * pi) - pi


class Party:
    """Several robots on errands on one floor."""

    def __init__(self, errands: Sequence[Errand]) -> None:
        self.errands = tuple(errands)
        self.by_uuid = {one.member.uuid: one for one in self.errands}

    def step(self, dt_s: float) -> None:
        """Let time pass for everybody; each stops for those just ahead of it."""
        bodies = [one.body() for one in self.errands]
        tree = shapely.STRtree(bodies)
        for row, one in enumerate(self.errands):
            ahead = set(tree.query(one.body(GAP_M), predicate="intersects").tolist()) - {row}
            one.step(dt_s, free=not (ahead or self._taken(one)))

    def _taken(self, one: Errand) -> bool:
        """Whether a robot that stands at a place wants one that another is still at."""
        wants = next((visit.place for visit in one.visits if visit.place), "")
        return bool(one.at and wants) and any(other.at == wants for other in self.errands if other is not one)
