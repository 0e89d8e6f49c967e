"""What a service of the site makes of advisories: it tells robots to wait, and where to go first or instead."""

from collections.abc import Iterable

import shapely

from deconflict.advisory import AdvisoryState, AnyAdvisory, Hold, Slot
from deconflict.contention.robots.place_geometry import Geometry
from deconflict.simulation.drills.errands import Errand, Party, Visit

STALE_S = 1.5
"""Advice may rest on what a robot said so long before it was told."""
WORTH_S = 0.3
"""A change of a robot's time by less is not worth telling it."""


class SiteService:
    """Tells the robots of a party what they are advised to do."""

    def __init__(self, party: Party, geometry: Geometry, start_s: float) -> None:
        """The party's time 0 is `start_s`, seconds since the epoch."""
        self._party, self._geometry, self._start_s = party, geometry, start_s
        self._held: dict[str, tuple[Hold, ...]] = {}
        """By advisory, the holds that were passed on last."""

    def take(self, advisory: AnyAdvisory) -> bool:
        """Pass on what a revision advises; whether any robot was told anything."""
        advice = advisory.recommendation
        if advice is None or advisory.state is AdvisoryState.CLEARED:
            return False
        at_s = advisory.updated_at.timestamp() - self._start_s
        held, self._held[advisory.id] = self._held.get(advisory.id, ()), advice.holds
        told = [self._hold(one, at_s) for one in advice.holds] if held != advice.holds else []
        told += [self._serve(robot, slots, at_s) for robot, slots in _by_robot(advice.slots).items()]
        return any(told)

    def _fresh(self, robot: str, at_s: float) -> Errand | None:
        """A robot of the party that has not changed its plan since what advice of `at_s` rests on."""
        one = self._party.by_uuid.get(robot)
        return None if one is None or one.deaf or at_s - STALE_S < one.told_s else one

    def _hold(self, hold: Hold, at_s: float) -> bool:
        """A hold comes on top of what the robot said that it would do."""
        one = self._fresh(hold.robot, at_s)
        if one:
            one.wait(hold.hold_s)
        return one is not None

    def _serve(self, robot: str, slots: list[Slot], at_s: float) -> bool:
        """Have a robot come when its last slot begins; before, it stays where an earlier one is."""
        one = self._fresh(robot, at_s)
        if one is None:
            return False
        *first, last = slots
        start_s = last.start_at.timestamp() - self._start_s
        if zone := self._geometry.zones.get(last.resource):
            return _come(one, one.enters_s(shapely.Polygon(zone.polygon)), start_s)
        told = one.comes_s(last.resource) is None
        if told:
            one.go_instead(self._visit(last.resource))
        elsewhere = [self._visit(slot.resource) for slot in first if one.comes_s(slot.resource) is None]
        if elsewhere:
            one.go(elsewhere)
            comes_s = one.comes_s(last.resource) or start_s
            one.visits[0] = self._visit(first[0].resource, max(start_s - comes_s, 0.0))
            return True
        return (not first and _come(one, one.comes_s(last.resource), start_s)) or told

    def _visit(self, place: str, stay_s: float = 0.0) -> Visit:
        _, x_m, y_m = self._geometry.middle(place)
        return Visit(x_m, y_m, place, stay_s)


def _come(one: Errand, comes_s: float | None, start_s: float) -> bool:
    """Shift a robot's time to come; whether that was worth telling it."""
    if comes_s is None or abs(start_s - comes_s) < WORTH_S:
        return False
    one.wait(start_s - comes_s)
    return True


def _by_robot(slots: Iterable[Slot]) -> dict[str, list[Slot]]:
    found: dict[str, list[Slot]] = {}
    for slot in sorted(slots, key=lambda each: each.start_at):
        found.setdefault(slot.robot, []).append(slot)
    return found
