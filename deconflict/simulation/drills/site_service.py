"""Site services: one follows every advisory, the other one only situations. They instruct robots on errands."""

from collections.abc import Iterable
from datetime import datetime
from typing import Literal

from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.simulation.drills.dispatcher import Dispatcher
from deconflict.simulation.drills.errands import Errand, ErrandGroup
from deconflict_client.advisory import Action, ActionKind, Hold, Slot
from deconflict_client.situations import AnyRevision, Situation

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
