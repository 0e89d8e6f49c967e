"""Site services: one follows every advisory, the other one only situations. They instruct robots on errands."""

from collections.abc import Iterable
from datetime import datetime
from math import cos, dist, hypot, sin
from typing import Literal

import shapely

from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.simulation.demo.advice_follower import STALE_S
from deconflict.simulation.drills.errands import Errand, ErrandGroup, Visit
from deconflict_client.advisory import Action, ActionKind, Hold, Slot
from deconflict_client.situations import AnyRevision, Situation

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


AdviceSource = Literal["advisories", "situations"]
"""Whose advice a site service follows."""

PASSES_S = 10.0
"""A robot that should drive slowly while the other one is ahead does so for this time: the conflict is over then."""


class SiteService:
    """Passes the holds and slots of every advisory on to the robots of a group."""

    def __init__(self, group: ErrandGroup, geometry: PlaceGeometry, start_s: float) -> None:
        """The group's time 0 is `start_s`, seconds since the epoch."""
        self._dispatcher, self._zones = Dispatcher(group, geometry, start_s), geometry.zones
        self._held: dict[str, tuple[Hold, ...]] = {}
        """By advisory: the holds that were passed on last."""

    def pass_on(self, advisory: AnyRevision) -> float | None:
        """Pass on the advice of a revision. Returns its cost; None if no robot was told anything."""
        advice = advisory.recommendation
        if advice is None:
            return None
        at_s = advisory.updated_at.timestamp() - self._dispatcher.start_s
        held, self._held[advisory.id] = self._held.get(advisory.id, ()), advice.holds
        held_s = [hold.hold_s for hold in advice.holds if held != advice.holds and self._hold(hold, at_s)]
        served = [self._serve(robot, slots, at_s) for robot, slots in _by_robot(advice.slots).items()]
        return advice.cost_s if any(served) else sum(held_s) if held_s else None

    def _hold(self, hold: Hold, at_s: float) -> bool:
        """Pass on a hold. It is added to the plan that the robot reported."""
        errand = self._dispatcher.fresh(hold.robot, at_s)
        if errand:
            errand.wait(hold.hold_s)
        return errand is not None

    def _serve(self, robot: str, slots: list[Slot], at_s: float) -> bool:
        """Make a robot arrive when its last slot begins. Before that it stays at the place of an earlier slot."""
        dispatcher, errand = self._dispatcher, self._dispatcher.fresh(robot, at_s)
        if errand is None:
            return False
        *first, last = slots
        start_s = last.start_at.timestamp() - dispatcher.start_s
        is_moved = last.resource not in self._zones and dispatcher.go_instead(errand, last.resource)
        if first and last.resource not in self._zones:
            until_s = first[0].end_at.timestamp() - dispatcher.start_s
            return dispatcher.go_first(errand, first[0].resource, until_s) or is_moved
        return dispatcher.arrive(errand, last.resource, start_s) or is_moved


class SituationService:
    """Passes the actions of situations on to the robots of a group, each piece of advice once."""

    def __init__(self, group: ErrandGroup, geometry: PlaceGeometry, start_s: float) -> None:
        """The group's time 0 is `start_s`, seconds since the epoch."""
        self._dispatcher = Dispatcher(group, geometry, start_s)
        self._passed_on: dict[str, str] = {}
        """By situation: since when the advice stands that was passed on last."""

    def pass_on(self, situation: AnyRevision) -> float | None:
        """Pass on new advice. Returns the seconds that robots were told to wait; None if none was told anything."""
        advice = situation.advice if isinstance(situation, Situation) else None
        if advice is None or self._passed_on.get(situation.id) == advice.since_at.isoformat():
            return None
        self._passed_on[situation.id] = advice.since_at.isoformat()
        at_s = situation.updated_at.timestamp() - self._dispatcher.start_s
        done = [action for action in advice.actions if self._act(action, at_s)]
        return sum(action.seconds or 0.0 for action in done) if done else None

    def _act(self, action: Action, at_s: float) -> bool:
        """Instruct the robot of an action. Returns whether it was told anything."""
        errand = self._dispatcher.fresh(action.robot, at_s)
        if errand is None:
            return False
        if action.action == "slow_down":
            errand.slow_down(action.speed_mps or errand.pace_mps, action.seconds or PASSES_S)
        elif action.resource and action.start_at and action.end_at:
            return self._serve(errand, action.action, action.resource, action.start_at, action.end_at)
        elif action.action == "wait":
            errand.wait(action.seconds or 0.0)
        else:
            return False
        return True

    def _serve(self, errand: Errand, action: ActionKind, place: str, start_at: datetime, end_at: datetime) -> bool:
        """Instruct a robot of an action about a place, at which it should be from `start_at` to `end_at`."""
        dispatcher = self._dispatcher
        start_s, end_s = (at.timestamp() - dispatcher.start_s for at in (start_at, end_at))
        match action:
            case "wait":
                return dispatcher.arrive(errand, place, start_s)
            case "take_another_route" if dispatcher.takes_its_place(errand, place):
                is_moved = dispatcher.go_instead(errand, place)
                return dispatcher.arrive(errand, place, start_s) or is_moved
            case "take_another_route":
                return dispatcher.go_first(errand, place, end_s)
            case "back_out":
                return dispatcher.back_out(errand, place, start_s)
        return False


SERVICES: dict[AdviceSource, type[SiteService] | type[SituationService]] = {
    "advisories": SiteService,
    "situations": SituationService,
}


def _by_robot(slots: Iterable[Slot]) -> dict[str, list[Slot]]:
    found: dict[str, list[Slot]] = {}
    for slot in sorted(slots, key=lambda each: each.start_at):
        found.setdefault(slot.robot, []).append(slot)
    return found
