"""What people can have done so that robots have the slots that were advised. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import Any

from deconflict.advice.actions.action_text import DRIVE_ASIDE, PERSON_REACTION_S, SHORTEST_WAIT_S
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.deadlocks import RingLink
from deconflict_client.advisory import Action, ActionKind, Recommendation, Slot
from deconflict_client.situations import MOST_ACTIONS

CHEAPER = "so they lose the least time in all"
"""Why of the robots of a ring this one makes way."""
LEAST_SAVING_S = 1.0
"""An order of a queue that saves less needs no action: the robots wait there by themselves."""


def with_queue_actions(
    advice: Recommendation | None, geometry: PlaceGeometry, robots: Mapping[str, RobotView]
) -> Recommendation | None:
    """The advice on a queue with its actions: who takes another place, who lets others go first, and who these are."""
    if advice is None or advice.expected_saving_s < LEAST_SAVING_S:
        return advice
    known = [slot for slot in advice.slots if slot.robot in robots]
    kept = [slot for slot in known if _asked(slot, geometry, robots) == slot.resource]
    moved = [slot for slot in known if slot not in kept]
    changes = [_elsewhere(slot, "instead", geometry, robots) for slot in moved]
    changes += [_wait(slot, geometry, robots) for slot in kept if any(_is_overtaken(slot, other) for other in kept)]
    first = [_go_first(slot.robot, robots) for slot in kept if any(_is_overtaken(other, slot) for other in kept)]
    arrives_at = {slot.robot: slot.start_at.timestamp() - slot.wait_s for slot in known}
    changes.sort(key=lambda action: arrives_at[action.robot])
    return _with(advice, [*changes, *first])


def with_ring_actions(
    advice: Recommendation | None,
    ring: Sequence[RingLink],
    geometry: PlaceGeometry,
    robots: Mapping[str, RobotView],
    now_s: float,
) -> Recommendation | None:
    """The advice on a ring with its actions: who goes elsewhere, waits or backs out first."""
    return advice and _with(advice, [*_ring_actions(advice, ring, geometry, robots, now_s)])


def _ring_actions(
    advice: Recommendation,
    ring: Sequence[RingLink],
    geometry: PlaceGeometry,
    robots: Mapping[str, RobotView],
    now_s: float,
) -> Iterator[Action]:
    waiters = [link.waiter for link in ring]
    if not advice.slots:
        first = robots[waiters[0]]
        reason = "no order of waiting ends it"
        yield Action(robot=first.uuid, name=first.name, action="look", reason=reason, task=DRIVE_ASIDE)
        return
    away, last = advice.slots[0], max(advice.slots, key=lambda slot: slot.wait_s)
    if away.resource not in {link.where for link in ring}:
        yield _elsewhere(away, "first", geometry, robots)
        return
    if _is_too_late_to_wait(robots[last.robot], last.resource, now_s):
        reason = next(
            (f"{robots[robot].name} pulls trailers and can't" for robot in waiters if robots[robot].pulls_trailers),
            CHEAPER,
        )
        yield _action(last, robots, "back_out", where=f"of {geometry.label(last.resource)}", reason=reason)
    else:
        yield _wait(last, geometry, robots).model_copy(update={"reason": CHEAPER})
    yield from (_go_first(robot, robots) for robot in waiters if robot != last.robot)


def _is_too_late_to_wait(robot: RobotView, lane: str, now_s: float) -> bool:
    """Whether a robot is in a lane, or will be before anybody can stop it. Trailers can't be backed out of it again."""
    passage, reaction_s = robot.passages.get(lane), 0.0 if robot.pulls_trailers else PERSON_REACTION_S
    return passage is not None and passage.enter_s <= now_s + reaction_s


def _with(advice: Recommendation, actions: Sequence[Action]) -> Recommendation:
    return advice.model_copy(update={"actions": tuple(actions[:MOST_ACTIONS])})


def _asked(slot: Slot, geometry: PlaceGeometry, robots: Mapping[str, RobotView]) -> str:
    """The place of the group that the robot is on its way to."""
    group = geometry.group(slot.resource)
    return next((stop.resource for stop in robots[slot.robot].stops if stop.resource in group), slot.resource)


def _is_overtaken(slot: Slot, other: Slot) -> bool:
    """Whether a robot would arrive at its place before another one and has its slot after it."""
    if slot.resource != other.resource or slot.start_at <= other.start_at:
        return False
    arrives, other_arrives = (each.start_at.timestamp() - each.wait_s for each in (slot, other))
    return arrives < other_arrives


def _wait(slot: Slot, geometry: PlaceGeometry, robots: Mapping[str, RobotView]) -> Action:
    """A short wait is made long enough for people: the order stays the same."""
    seconds = float(ceil(max(slot.wait_s, SHORTEST_WAIT_S)))
    return _action(slot, robots, "wait", seconds=seconds, where=f"before {geometry.label(slot.resource)}")


def _elsewhere(slot: Slot, when: str, geometry: PlaceGeometry, robots: Mapping[str, RobotView]) -> Action:
    where = f"to {geometry.label(slot.resource)} {when}"
    return _action(slot, robots, "take_another_route", where=where)


def _go_first(robot: str, robots: Mapping[str, RobotView]) -> Action:
    return Action(robot=robot, name=robots[robot].name, action="go_first")


def _action(slot: Slot, robots: Mapping[str, RobotView], action: ActionKind, **fields: Any) -> Action:
    stay = {"resource": slot.resource, "start_at": slot.start_at, "end_at": slot.end_at}
    return Action(robot=slot.robot, name=robots[slot.robot].name, action=action, **stay, **fields)
