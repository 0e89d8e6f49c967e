"""Advisories and the situations that they make, for tests."""

from collections.abc import Sequence
from typing import Any

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.words import Spot
from deconflict_client.advisory import (
    Action,
    AnyAdvisory,
    BlockageAdvisory,
    ConflictAdvisory,
    ContentionAdvisory,
    DeadlockAdvisory,
    EncounterClass,
    Location,
    Recommendation,
    Wait,
    moment,
)
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import Situation
from tests.helpers.made_advisories import made, made_advice
from tests.helpers.saying import HALL

NOW_S = 1_790_000_000.0


def conflict(
    robots: str, left_s: float = 8.0, x_m: float = 0.0, now_s: float = NOW_S, **fields: Any
) -> ConflictAdvisory:
    """A conflict of two robots, each named by one letter."""
    whole: dict[str, Any] = {
        "id": f"conflict {robots}",
        "robots": tuple(sorted(robots)),
        "names": tuple(f"Robot {letter}" for letter in sorted(robots)),
        "raised_at": moment(now_s),
        "updated_at": moment(now_s),
        "predicted_at": moment(now_s + left_s),
        "time_to_conflict_s": max(left_s, 0.0),
        "probability": 0.8,
        "location": Location(datum=HALL, x=x_m, y=0.0),
        "summary": f"Robot {min(robots)} and Robot {max(robots)} cross in {left_s:.0f} s",
    }
    return made(1, **(whole | fields))


def head_on(robots: str, left_s: float = 8.0, **fields: Any) -> ConflictAdvisory:
    """A conflict that costs so much that robots should wait for some seconds to prevent it."""
    return conflict(robots, left_s, **({"encounter_class": EncounterClass.HEAD_ON} | fields))


def finding(kind: str, robots: str, **fields: Any) -> Any:
    """The fields of a contention or blockage that `robots` are in."""
    first = conflict("ab")
    whole = first.model_dump(include=set(BlockageAdvisory.model_fields) - {"kind"})
    return whole | {
        "id": f"{kind} {robots}",
        "kind": kind,
        "robots": tuple(sorted(robots)),
        "names": tuple(f"Robot {letter}" for letter in sorted(robots)),
        "vendors": ("Acme",) * len(robots),
        **fields,
    }


def queue(robots: str, wait_s: float = 40.0, **fields: Any) -> ContentionAdvisory:
    """Robots that wait for a dock."""
    place = {"resource": "dock-1", "resource_name": "Dock 1", "capacity": 1, "demand": len(robots)}
    lengths = {"queue_length": len(robots) - 1, "wait_s": wait_s}
    return ContentionAdvisory(**finding("contention", robots, **(place | lengths | fields)))


def blockage(robots: str, **fields: Any) -> BlockageAdvisory:
    """The first robot stands in the way of the others."""
    blocker, held_up = robots[0], robots[1:]
    evidence = {"blocker": blocker, "since_at": moment(NOW_S - 30), "holds_up": tuple(held_up)}
    return BlockageAdvisory(**finding("blockage", robots, **evidence, **fields))


def deadlock(robots: str, **fields: Any) -> DeadlockAdvisory:
    """Robots that lock each other in a ring."""
    ring = zip(robots, robots[1:] + robots[0], strict=True)
    cycle = tuple(Wait(waiter=a, holder=b, where="lane", from_at=moment(NOW_S)) for a, b in ring)
    return DeadlockAdvisory(**finding("deadlock", robots, cycle=cycle, **fields))


def request(number: int, robot: str, other: str, after_s: float = 0.0, **fields: Any) -> RobotAdvice:
    """One robot is asked for another. Each is named by one letter."""
    robots = tuple(sorted((robot, other)))
    at = moment(NOW_S + after_s)
    times = {"raised_at": at, "updated_at": at, "predicted_at": at, "latest_at": moment(NOW_S + after_s + 20)}
    names = tuple(f"Robot {letter}" for letter in robots)
    return made_advice(number, robots=robots, names=names, robot=robot, other=other, **(times | fields))


def advice(*actions: Action) -> Recommendation:
    return Recommendation(actions=actions, cost_s=0.0, bound_s=0.0, proven_optimal=True)


def action(robot: str, name: Any = "wait", **fields: Any) -> Action:
    seconds = {"seconds": 4.0} if name == "wait" else {}
    return Action(robot=robot, name=f"Robot {robot}", action=name, **(seconds | fields))


def lifecycle() -> SituationLifecycle:
    return SituationLifecycle(lambda points: [Spot("in Aisle 3")] * len(points))


def raised(advisories: Sequence[AnyAdvisory], now_s: float = NOW_S) -> Situation:
    """The only situation that some advisories make."""
    (situation,) = lifecycle().revise(now_s, advisories)
    return situation
