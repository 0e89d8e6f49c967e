"""What a site service can tell robots on errands: to wait, to be at a place at a time, to go elsewhere, to back out."""

from math import cos, dist, hypot, sin

import shapely

from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.simulation.demo.advice_follower import STALE_S
from deconflict.simulation.drills.errands import Errand, ErrandGroup, Visit

WORTH_S = 0.3
"""A smaller change of a robot's arrival time is not passed on."""
OUT_M = 0.5
"""A robot that has backed out of a lane stands this far before it."""


class Dispatcher:
    """Instructs the robots of a group. Its time 0 is `start_s`, seconds since the epoch."""

    def __init__(self, group: ErrandGroup, geometry: PlaceGeometry, start_s: float) -> None:
        self._group, self._geometry, self.start_s = group, geometry, start_s

    def fresh(self, robot: str, at_s: float) -> Errand | None:
        """The errand of a robot, if its plan has not changed since the reports on which advice of `at_s` is based."""
        errand = self._group.by_uuid.get(robot)
        return None if errand is None or errand.ignores_advice or at_s - STALE_S < errand.told_s else errand

    def arrive(self, errand: Errand, place: str, at_s: float) -> bool:
        """Let a robot be at a resource, or enter a zone, at a time. Returns whether that changed enough."""
        zone = self._geometry.zones.get(place)
        comes_s = errand.enters_s(shapely.Polygon(zone.polygon)) if zone else errand.comes_s(place)
        if comes_s is None or abs(at_s - comes_s) < WORTH_S:
            return False
        errand.wait(at_s - comes_s)
        return True

    def go_instead(self, errand: Errand, place: str) -> bool:
        """Let a robot go to another resource than it planned. Returns whether it planned another one."""
        if errand.comes_s(place) is not None:
            return False
        errand.go_instead(self._visit(place))
        return True

    def go_first(self, errand: Errand, place: str, until_s: float) -> bool:
        """Let a robot go to a resource first and stay until a time. Returns whether it had not planned that."""
        if errand.comes_s(place) is not None:
            return False
        errand.go([self._visit(place)])
        errand.visits[0] = self._visit(place, max(until_s - (errand.comes_s(place) or until_s), 0.0))
        return True

    def takes_its_place(self, errand: Errand, place: str) -> bool:
        """Whether a resource is interchangeable with the next one that a robot goes to."""
        planned = next((visit.place for visit in errand.visits if visit.place), None)
        return planned is not None and place in self._geometry.group(planned)

    def back_out(self, errand: Errand, lane: str, again_s: float) -> bool:
        """Let a robot leave a lane where it came in, and come again at a time. Returns whether it is a lane."""
        zone = self._geometry.zones.get(lane)
        if zone is None or zone.axis is None:
            return False
        ahead = cos(errand.yaw_rad), sin(errand.yaw_rad)
        end, other = sorted(zone.axis, key=lambda point: point[0] * ahead[0] + point[1] * ahead[1])
        out_m = errand.member.make.body.length_m + OUT_M
        share = 1.0 + out_m / dist(end, other)
        x_m, y_m = (b + share * (a - b) for a, b in zip(end, other, strict=True))
        way_s = hypot(x_m - errand.x_m, y_m - errand.y_m) / errand.pace_mps
        errand.go([Visit(x_m, y_m, stay_s=max(again_s - errand.t_s - way_s, 0.0))])
        return True

    def _visit(self, place: str, stay_s: float = 0.0) -> Visit:
        _, x_m, y_m = self._geometry.middle(place)
        return Visit(x_m, y_m, place, stay_s)
