"""What two robots truly did, from their own reports, and the least delay of one that would have kept them apart."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np

from deconflict.roles.receiver import fleet_of
from deconflict.site import Site
from deconflict.sweep import sweep
from ingest.measures import Measures
from ingest.playback import Received
from ingest.robots import Robot
from ingest.seam import Forecasts

JOINED_S = 2.1
"""Reports further apart say nothing of what lay between them, unless the robot had not moved."""
STOOD_M = 0.1
STEP_S = 0.1
"""Delays are tried in steps of this."""
LONGEST_S = 20.0
"""The longest that is tried; the pair must keep apart for as long before and after."""


@dataclass(slots=True, eq=False)
class Track:
    """One robot's reports: time, envelope centre, heading and floor, a row each."""

    name: str = ""
    vendor: str = ""
    knots: list[tuple[float, float, float, float, int]] = field(default_factory=list)
    length_m: float = 0.0
    width_m: float = 0.0
    bottom_m: float = 0.0
    top_m: float = 0.0

    def take(self, robot: Robot) -> None:
        """The robot as it is known now, if that is newer."""
        one = robot.forecast
        if one is None or (self.knots and one.knots[0][0] <= self.knots[-1][0]):
            return
        self.name, self.vendor = robot.name, robot.vendor
        t_s, x_m, y_m, yaw_rad = one.knots[0]
        if self.knots:
            last = self.knots[-1]
            if t_s - last[0] > JOINED_S and hypot(x_m - last[1], y_m - last[2]) > STOOD_M:
                self.knots.append((last[0] + 1e-3, *last[1:4], -1))
        self.knots.append((t_s, x_m, y_m, yaw_rad, one.floors[0]))
        self.length_m, self.width_m, self.bottom_m, self.top_m = one.length_m, one.width_m, one.bottom_m, one.top_m

    def way(self) -> Forecasts:
        """The reports as one forecast, joined linearly; nowhere once they have ended for `JOINED_S`."""
        last = self.knots[-1]
        knots = np.array([*self.knots, (last[0] + JOINED_S, *last[1:4], -1)])
        return Forecasts(
            start=np.array([0, len(knots)]),
            t_s=knots[:, 0],
            x_m=knots[:, 1],
            y_m=knots[:, 2],
            yaw_rad=knots[:, 3],
            floor=knots[:, 4].astype(np.int64),
            length_m=np.array([self.length_m]),
            width_m=np.array([self.width_m]),
            bottom_m=np.array([self.bottom_m]),
            top_m=np.array([self.top_m]),
        )


@dataclass(frozen=True, slots=True)
class Met:
    """How near two came."""

    began_s: float
    """When they first were within the clearance."""
    separation_m: float
    """The least there was; 0 where they overlapped."""
    at_s: float


def tracks(site: Site, events: Iterable[Received], robots: Iterable[str]) -> tuple[dict[str, Track], tuple[str, ...]]:
    """By robot, as their messages tell, and the floors that the tracks count through. Robots unheard of have none."""
    fleet, found = fleet_of(site, Measures()), {uuid: Track() for uuid in robots}
    now_s = 0.0
    for event in events:
        now_s = event.arrival_s
        if event.refused is None and fleet.receive(event.raw, event.arrival_s, event.connection) is None:
            for uuid, track in found.items():
                robot = fleet.robots.get(uuid)
                if robot:
                    track.take(robot)
    return {uuid: one for uuid, one in found.items() if one.knots}, fleet.whole(now_s).floors


def met(a: Forecasts, b: Forecasts, clearance_m: float, begin_s: float, end_s: float) -> Met | None:
    """How near they came between two times; None where that was not within the clearance."""
    found = sweep(Forecasts.joined([a, b]), now_s=begin_s, horizon_s=end_s - begin_s, clearance_m=clearance_m)
    if not len(found.pairs):
        return None
    return Met(float(found.contact_s[0]), float(found.separation_m[0]), float(found.separation_at_s[0]))


def avoiding_s(a: Forecasts, b: Forecasts, clearance_m: float, at_s: float) -> tuple[float | None, float | None]:
    """How much later each of the two, the other being as it was, need have been; None where no delay would do.

    Every delay is swept at once, each on a floor of its own.
    """
    delays_s = np.arange(STEP_S, LONGEST_S + STEP_S / 2, STEP_S).round(3).tolist()
    cases = [(_later(a, delay_s), b) for delay_s in delays_s] + [(a, _later(b, delay_s)) for delay_s in delays_s]
    floors = 1 + max(int(a.floor.max()), int(b.floor.max()))
    rows = [_on_floor(one, number * floors) for number, case in enumerate(cases) for one in case]
    found = sweep(Forecasts.joined(rows), now_s=at_s - LONGEST_S, horizon_s=2 * LONGEST_S, clearance_m=clearance_m)
    meeting = {int(row) // 2 for row, _ in found.pairs.tolist()}
    return _least(delays_s, meeting, 0), _least(delays_s, meeting, len(delays_s))


def _least(delays_s: Sequence[float], meeting: set[int], first_case: int) -> float | None:
    return next((delay_s for case, delay_s in enumerate(delays_s, first_case) if case not in meeting), None)


def _later(one: Forecasts, delay_s: float) -> Forecasts:
    return replace(one, t_s=one.t_s + delay_s)


def _on_floor(one: Forecasts, base: int) -> Forecasts:
    return replace(one, floor=np.where(one.floor < 0, -1, one.floor + base))
