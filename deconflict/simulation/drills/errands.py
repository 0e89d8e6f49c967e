"""Robots on errands: they drive from place to place in straight lines, and wait or go elsewhere first if told to.

A robot reports its present plan, including waits. It leaves a place only once the next one is free. It drives only
while the floor just ahead of it is free.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan2, copysign, cos, hypot, inf, sin

import numpy as np
import shapely

from deconflict.simulation.fleet_plans import FleetPlan
from deconflict.simulation.floor_layout import GROUND
from deconflict.simulation.participants import Participant
from deconflict.simulation.robot_state import RobotState
from ingest.frames.angles import turn_between

PACE_MPS = 1.0
TURN_RADPS = 1.5
SLACK_M, SLACK_RAD = 1e-6, 0.01
STEP_S = 0.1
GAP_M = 0.2
"""A robot stops if another is nearer than this ahead of it. Less than the demo's clearance."""


@dataclass(frozen=True, slots=True)
class Visit:
    """A position that a robot drives to, and how long it stays there. With no stay it drives through."""

    x_m: float
    """In the floor's frame."""
    y_m: float
    place: str = ""
    """Id of a resource."""
    stay_s: float = 0.0
    """How long it stays."""
    state: str = "waitingExternalEvent"
    """The state that it reports while it is there."""


@dataclass(frozen=True, slots=True)
class Knot:
    """The planned pose of a robot after a time. `visit` is set if it has just arrived there."""

    after_s: float
    """Seconds from now."""
    x_m: float
    y_m: float
    yaw_rad: float
    visit: Visit | None = None


class Errand:
    """One robot. Its time advances only by `step`."""

    def __init__(
        self, member: Participant, start: tuple[float, float], visits: Sequence[Visit], *, ignores_advice: bool = False
    ):
        """It stands at `start`, heading for its first visit. With `ignores_advice` no site service instructs it."""
        self.member, self.visits, self.ignores_advice = member, list(visits), ignores_advice
        self.x_m, self.y_m = start
        self.yaw_rad = self._heading_rad(self.visits[0])
        self.t_s = 0.0
        self._stay_s, self._state = 0.0, "navigating"
        self._hold_s = 0.0
        self._slow_mps, self._slow_s = PACE_MPS, 0.0
        """A lower speed, and for how long it drives at it."""
        self.at = ""
        """Id of the place where it is."""
        self.due_s = self._timetable()[-1].after_s
        """When it would finish without obstacles."""
        self.through_s: float | None = None
        """When it finished."""
        self.told_s = -inf
        """When it last changed its plan on an instruction."""

    def step(self, dt_s: float, *, free: bool) -> None:
        """Advance the time by `dt_s`. If not `free`, it can't drive."""
        left_s = dt_s
        while left_s > 1e-9:
            used_s = self._act(left_s, free)
            left_s -= used_s
            self.t_s += used_s

    def _act(self, most_s: float, free: bool) -> float:
        """Do the next action for at most `most_s`. Returns how long it took."""
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
        turn_rad = turn_between(self.yaw_rad, self._heading_rad(visit))
        if abs(turn_rad) > SLACK_RAD:
            used_s = min(abs(turn_rad) / TURN_RADPS, most_s)
            self.yaw_rad += copysign(used_s * TURN_RADPS, turn_rad)
            return used_s
        return self._drive(visit, left_m, most_s) if free else most_s

    def _drive(self, visit: Visit, left_m: float, most_s: float) -> float:
        self.at = ""
        used_s = min(left_m / self.pace_mps, most_s, self._slow_s or most_s)
        share = used_s * self.pace_mps / left_m
        self._slow_s = max(self._slow_s - used_s, 0.0)
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
    def pace_mps(self) -> float:
        """Its speed when it drives."""
        return self._slow_mps if self._slow_s > 0 else PACE_MPS

    @property
    def late_s(self) -> float:
        """How much later than first planned it finished, or will finish."""
        ends_s = self.t_s + self._timetable()[-1].after_s if self.through_s is None else self.through_s
        return ends_s - self.due_s

    def wait(self, more_s: float) -> None:
        """Stand `more_s` longer before driving on. A negative value shortens an earlier wait."""
        self._hold_s = max(self._hold_s + more_s, 0.0)
        self.told_s = self.t_s

    def slow_down(self, speed_mps: float, seconds: float) -> None:
        """Drive at most at this speed for the next `seconds` of driving; with 0 s, as fast as usual again."""
        self._slow_mps, self._slow_s = min(speed_mps, PACE_MPS), seconds
        self.told_s = self.t_s

    def go(self, visits: Sequence[Visit]) -> None:
        """Go to these positions first."""
        self.visits[:0] = visits
        self.told_s = self.t_s

    def go_instead(self, visit: Visit) -> None:
        """Go to the place of `visit` instead of the next place, for the same stay."""
        row = next(row for row, planned in enumerate(self.visits) if planned.place)
        self.visits[row] = replace(self.visits[row], x_m=visit.x_m, y_m=visit.y_m, place=visit.place)
        self.told_s = self.t_s

    def comes_s(self, place: str) -> float | None:
        """When it will arrive at a place. None if it does not go there."""
        return next(
            (self.t_s + knot.after_s for knot in self._timetable() if knot.visit and knot.visit.place == place), None
        )

    def enters_s(self, outline: shapely.Polygon) -> float | None:
        """When its front enters an outline. None if it does not."""
        knots, body = self._timetable(), self.member.make.body
        after_s = np.arange(0.0, knots[-1].after_s + STEP_S, STEP_S)
        times_s = [knot.after_s for knot in knots]
        x_m, y_m = (np.interp(after_s, times_s, [getattr(knot, name) for knot in knots]) for name in ("x_m", "y_m"))
        apart_m = shapely.distance(shapely.points(x_m, y_m), outline)
        touching = np.flatnonzero(apart_m <= body.ahead_m + body.length_m / 2)
        return self.t_s + float(after_s[touching[0]]) if len(touching) else None

    def body(self, ahead_m: float = 0.0) -> shapely.Polygon:
        """Its envelope, extended ahead."""
        size = self.member.make.body
        back, front = size.ahead_m - size.length_m / 2, size.ahead_m + size.length_m / 2 + ahead_m
        c, s, wide = cos(self.yaw_rad), sin(self.yaw_rad), size.width_m / 2
        corners = [(back, -wide), (front, -wide), (front, wide), (back, wide)]
        return shapely.Polygon([(self.x_m + c * a - s * b, self.y_m + s * a + c * b) for a, b in corners])

    def robot(self) -> RobotState:
        """Everything that its vendor's dialect can report."""
        knots = self._timetable()
        would_drive = bool(self.visits) and self._hold_s <= 0 and self._stay_s <= 0
        return RobotState(
            member=self.member,
            t_s=self.t_s,
            floor=GROUND,
            x_m=self.x_m,
            y_m=self.y_m,
            yaw_rad=self.yaw_rad,
            linear_mps=self.pace_mps if would_drive else 0.0,
            state=self._state,
            battery_pct=50.0,
            plan=FleetPlan(
                np.array([knot.after_s for knot in knots]),
                np.array([(knot.x_m, knot.y_m, knot.yaw_rad) for knot in knots]),
                np.full(len(knots), GROUND),
            ),
            destinations=tuple(
                (knot.after_s, GROUND, knot.x_m, knot.y_m, knot.yaw_rad)
                for knot in knots
                if knot.visit and (knot.visit.place or knot.visit is self.visits[-1])
            ),
        )

    def _timetable(self) -> list[Knot]:
        """Its planned poses from now on without obstacles. It stays at the last."""
        x_m, y_m, yaw_rad = self.x_m, self.y_m, self.yaw_rad
        after_s, slow_m = self._hold_s + self._stay_s, self._slow_mps * self._slow_s
        knots = [Knot(0.0, x_m, y_m, yaw_rad)]
        if after_s > 0:
            knots.append(Knot(after_s, x_m, y_m, yaw_rad))
        for visit in self.visits:
            left_m = hypot(visit.x_m - x_m, visit.y_m - y_m)
            if left_m > SLACK_M:
                turn_rad = turn_between(yaw_rad, atan2(visit.y_m - y_m, visit.x_m - x_m))
                if abs(turn_rad) > SLACK_RAD:
                    after_s, yaw_rad = after_s + abs(turn_rad) / TURN_RADPS, yaw_rad + turn_rad
                    knots.append(Knot(after_s, x_m, y_m, yaw_rad))
                slowly_m = min(slow_m, left_m)
                after_s, slow_m = after_s + slowly_m / self._slow_mps, slow_m - slowly_m
                if 0 < slowly_m < left_m:
                    share = slowly_m / left_m
                    at = x_m + share * (visit.x_m - x_m), y_m + share * (visit.y_m - y_m)
                    knots.append(Knot(after_s, *at, yaw_rad))
                after_s += (left_m - slowly_m) / PACE_MPS
            x_m, y_m = visit.x_m, visit.y_m
            knots.append(Knot(after_s, x_m, y_m, yaw_rad, visit))
            if visit.stay_s > 0:
                after_s += visit.stay_s
                knots.append(Knot(after_s, x_m, y_m, yaw_rad))
        return knots

    def _heading_rad(self, visit: Visit) -> float:
        return atan2(visit.y_m - self.y_m, visit.x_m - self.x_m)


class ErrandGroup:
    """Several robots on errands on one floor."""

    def __init__(self, errands: Sequence[Errand]) -> None:
        self.errands = tuple(errands)
        self.by_uuid = {errand.member.uuid: errand for errand in self.errands}

    def step(self, dt_s: float) -> None:
        """Advance all robots. Each stops for robots just ahead of it."""
        bodies = [errand.body() for errand in self.errands]
        tree = shapely.STRtree(bodies)
        for row, errand in enumerate(self.errands):
            ahead = set(tree.query(errand.body(GAP_M), predicate="intersects").tolist()) - {row}
            errand.step(dt_s, free=not (ahead or self._taken(errand)))

    def _taken(self, errand: Errand) -> bool:
        """Whether a robot that stands at a place needs a place where another still is."""
        wants = next((visit.place for visit in errand.visits if visit.place), "")
        return bool(errand.at and wants) and any(other.at == wants for other in self.errands if other is not errand)
