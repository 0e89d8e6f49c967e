"""A site service that follows advisories: it tells robots to wait, and where to go first or instead."""

from collections.abc import Iterable

import shapely

from deconflict.advisory import AnyAdvisory, Hold, Slot
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.simulation.drills.errands import Errand, ErrandGroup, Visit

STALE_S = 1.5
"""Advice may be based on reports this much older than the advice."""
WORTH_S = 0.3
"""A smaller change of a robot's arrival time is not passed on."""


class SiteService:
    """Passes advice on to the robots of a group."""

    def __init__(self, group: ErrandGroup, geometry: PlaceGeometry, start_s: float) -> None:
        """The group's time 0 is `start_s`, seconds since the epoch."""
        self._group, self._geometry, self._start_s = group, geometry, start_s
        self._held: dict[str, tuple[Hold, ...]] = {}
        """By advisory: the holds that were passed on last."""

    def pass_on(self, advisory: AnyAdvisory) -> float | None:
        """Pass on the advice of a revision. Returns its cost; None if no robot was told anything."""
        advice = advisory.recommendation
        if advice is None:
            return None
        at_s = advisory.updated_at.timestamp() - self._start_s
        held, self._held[advisory.id] = self._held.get(advisory.id, ()), advice.holds
        held_s = [hold.hold_s for hold in advice.holds if held != advice.holds and self._hold(hold, at_s)]
        served = [self._serve(robot, slots, at_s) for robot, slots in _by_robot(advice.slots).items()]
        return advice.cost_s if any(served) else sum(held_s) if held_s else None

    def _fresh(self, robot: str, at_s: float) -> Errand | None:
        """The errand of a robot, if its plan has not changed since the reports on which advice of `at_s` is based."""
        errand = self._group.by_uuid.get(robot)
        return None if errand is None or errand.ignores_advice or at_s - STALE_S < errand.told_s else errand

    def _hold(self, hold: Hold, at_s: float) -> bool:
        """Pass on a hold. It is added to the plan that the robot reported."""
        errand = self._fresh(hold.robot, at_s)
        if errand:
            errand.wait(hold.hold_s)
        return errand is not None

    def _serve(self, robot: str, slots: list[Slot], at_s: float) -> bool:
        """Make a robot arrive when its last slot begins. Before that it stays at the place of an earlier slot."""
        errand = self._fresh(robot, at_s)
        if errand is None:
            return False
        *first, last = slots
        start_s = last.start_at.timestamp() - self._start_s
        if zone := self._geometry.zones.get(last.resource):
            return _shift_arrival(errand, errand.enters_s(shapely.Polygon(zone.polygon)), start_s)
        is_moved = errand.comes_s(last.resource) is None
        if is_moved:
            errand.go_instead(self._visit(last.resource))
        elsewhere = [self._visit(slot.resource) for slot in first if errand.comes_s(slot.resource) is None]
        if elsewhere:
            errand.go(elsewhere)
            comes_s = errand.comes_s(last.resource) or start_s
            errand.visits[0] = self._visit(first[0].resource, max(start_s - comes_s, 0.0))
            return True
        return (not first and _shift_arrival(errand, errand.comes_s(last.resource), start_s)) or is_moved

    def _visit(self, place: str, stay_s: float = 0.0) -> Visit:
        _, x_m, y_m = self._geometry.middle(place)
        return Visit(x_m, y_m, place, stay_s)


def _shift_arrival(errand: Errand, comes_s: float | None, start_s: float) -> bool:
    """Shift a robot's arrival. Returns whether the change was large enough to be passed on."""
    if comes_s is None or abs(start_s - comes_s) < WORTH_S:
        return False
    errand.wait(start_s - comes_s)
    return True


def _by_robot(slots: Iterable[Slot]) -> dict[str, list[Slot]]:
    found: dict[str, list[Slot]] = {}
    for slot in sorted(slots, key=lambda each: each.start_at):
        found.setdefault(slot.robot, []).append(slot)
    return found
