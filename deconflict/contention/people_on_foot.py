"""What people on foot are not told: they go around each other, and the vehicle yields."""

from collections.abc import Iterable, Iterator, Mapping

from deconflict.advisories.finding_lifecycle import Finding
from deconflict.contention.robots.robot_view import RobotView

TO_VEHICLES = frozenset(("wait", "slow_down", "back_out", "take_another_route"))
"""Actions that are asked of vehicles only."""


def of_vehicles(found: Iterable[Finding], robots: Mapping[str, RobotView]) -> Iterator[Finding]:
    """The findings that are not of people on foot alone, without what they ask of people on foot.

    Who goes first is said as long as somebody yields.
    """
    for finding in found:
        on_foot = [uuid in robots and robots[uuid].on_foot for uuid in finding.robots]
        if all(on_foot):
            continue
        yield _asking_vehicles(finding, robots) if any(on_foot) else finding


def _asking_vehicles(finding: Finding, robots: Mapping[str, RobotView]) -> Finding:
    advice = finding.recommendation
    if advice is None:
        return finding
    kept = [action for action in advice.actions if not (action.action in TO_VEHICLES and robots[action.robot].on_foot)]
    if len(kept) == len(advice.actions):
        return finding
    is_yielded = any(action.action != "go_first" for action in kept)
    return finding._replace(recommendation=advice.model_copy(update={"actions": tuple(kept if is_yielded else ())}))
