"""What would help against a blockage: what becomes of the blocker, and what the robots do that it holds up.

The actions are not proven: neither a way out for the blocker nor another route for the others is known.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from math import ceil, hypot
from typing import Any

from deconflict.advice.actions.action_text import DRIVE_ON, SHORTEST_WAIT_S
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.waiting.blockages import Blockage
from deconflict.contention.waiting.detours import Refuge
from deconflict.contention.waiting.standing_reasons import is_silent, needs_person, state_phrase, task_at
from deconflict_client.advisory import Action, ActionKind, Recommendation

MOST_HELD_UP = 2
"""Robots that are held up and get an action, the soonest first."""
SHORT_S = 15.0
"""If the blocker is expected to move on within this time, waiting for it is better than another route."""
UNEXPLAINED_S = 60.0
"""After this time a person should find out why a robot stands that is not expected to."""


def blockage_advice(
    blocked: Blockage,
    robots: Mapping[str, RobotView],
    geometry: PlaceGeometry,
    refuges: Sequence[Refuge],
    left_s: float,
    quiet_after_s: float,
    now_s: float,
) -> Recommendation:
    """The advice, with at least one action. The blocker is expected to stand `left_s` longer."""
    blocker = robots[blocked.blocker]
    if _needs_look(blocker, now_s - blocked.since_s, quiet_after_s, now_s):
        is_quiet = is_silent(blocker, quiet_after_s, now_s)
        reason = "silent" if is_quiet else state_phrase(blocker, quiet_after_s, now_s)
        of_blocker = [_action(blocker, "look", reason=reason, task=task_at(blocker, is_quiet))]
    elif blocker.state == "idle":
        of_blocker = [_way_out(blocker, geometry, refuges)]
    else:
        of_blocker = []
    of_others = islice(_actions_of_held_up(blocked, robots, left_s), MOST_HELD_UP)
    return Recommendation(actions=(*of_blocker, *of_others), cost_s=0.0, bound_s=0.0, proven_optimal=False)


def _needs_look(blocker: RobotView, stood_s: float, quiet_after_s: float, now_s: float) -> bool:
    """Whether a person should look at the blocker: it asks for a person, or it stands without a known reason."""
    if needs_person(blocker, quiet_after_s, now_s) or blocker.state == "waitingHumanEvent":
        return True
    return blocker.state not in {"idle", "charging"} and stood_s >= UNEXPLAINED_S


def _way_out(blocker: RobotView, geometry: PlaceGeometry, refuges: Sequence[Refuge]) -> Action:
    """Where an idle blocker can go: to the nearest free resource of its floor; else back, but no train."""
    near = [refuge for refuge in refuges if refuge.datum == blocker.datum]
    if not near and blocker.pulls_trailers:
        return _action(blocker, "look", reason="pulls trailers and can't back out", task=DRIVE_ON)
    if not near:
        return _action(blocker, "back_out", where="of the way")
    nearest = min(near, key=lambda refuge: hypot(refuge.x_m - blocker.x_m, refuge.y_m - blocker.y_m)).resource
    return _action(blocker, "take_another_route", resource=nearest, where=f"to {geometry.label(nearest)}")


def _actions_of_held_up(blocked: Blockage, robots: Mapping[str, RobotView], left_s: float) -> Iterator[Action]:
    around = f"around {robots[blocked.blocker].name}"
    for uuid in blocked.holds_up:
        if left_s <= SHORT_S:
            yield _action(robots[uuid], "wait", seconds=max(float(ceil(left_s)), SHORTEST_WAIT_S))
        else:
            yield _action(robots[uuid], "take_another_route", where=around)


def _action(robot: RobotView, action: ActionKind, **fields: Any) -> Action:
    return Action(robot=robot.uuid, name=robot.name, action=action, **fields)
