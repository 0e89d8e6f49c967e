"""Advisories made for tests."""

from datetime import UTC, datetime, timedelta
from typing import Any

from deconflict.settings.site import StoreSettings
from deconflict_client.advisory import (
    Action,
    AdvisoryState,
    ConflictAdvisory,
    DeadlockAdvisory,
    EncounterClass,
    Location,
    Severity,
    Wait,
)
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import Situation, SituationAdvice

START = datetime(2024, 5, 1, 8, 0, tzinfo=UTC)
KEEPING = StoreSettings(keep_days=36_500.0)
"""A running service keeps advisories that were cleared at `START`: with its default it removes them when it prunes."""
ROBOTS = ("0c5b4a7e-0000-4000-8000-000000000001", "0c5b4a7e-0000-4000-8000-000000000002")


def made(number: int, revision: int = 1, **fields: Any) -> ConflictAdvisory:
    """A revision of the advisory with this number. Revision 1 is raised; each later one is updated a second later."""
    updated_at = START + timedelta(minutes=number, seconds=revision - 1)
    state = AdvisoryState.RAISED if revision == 1 else AdvisoryState.UPDATED
    whole: dict[str, Any] = {
        "id": f"advisory-{number}",
        "revision": revision,
        "state": state,
        "severity": Severity.WARNING,
        "encounter": 1,
        "encounter_class": EncounterClass.CROSSING,
        "robots": ROBOTS,
        "names": ("Tug 1", "Lift 2"),
        "vendors": ("Acme", "Borealis"),
        "basis": ("path", "velocity"),
        "raised_at": START + timedelta(minutes=number),
        "updated_at": updated_at,
        "predicted_at": updated_at + timedelta(seconds=4.25),
        "time_to_conflict_s": 4.25,
        "clearance_m": 0.3,
        "min_separation_m": 0.1,
        "closing_speed_mps": 1.5,
        "location": Location(datum="5f1d0000-0000-4000-8000-00000000000a", x=1.0 / 3.0, y=-2.5),
        "summary": "Tug 1 and Lift 2 cross in 4 s",
    }
    return ConflictAdvisory(**(whole | fields))


def cleared(number: int, revision: int = 2, **fields: Any) -> ConflictAdvisory:
    """The revision that clears the advisory with this number."""
    when = START + timedelta(minutes=number, seconds=revision - 1)
    ended = {"state": AdvisoryState.CLEARED, "cleared_at": when, "cleared_because": "they passed"}
    return made(number, revision, **(ended | fields))


def deadlock(*robots: str) -> DeadlockAdvisory:
    """A ring in which each robot waits for the next."""
    ring = zip(robots, robots[1:] + robots[:1], strict=True)
    return DeadlockAdvisory(
        id="deadlock " + " ".join(robots),
        revision=1,
        state=AdvisoryState.RAISED,
        severity=Severity.WARNING,
        robots=robots,
        names=robots,
        vendors=("Acme",) * len(robots),
        raised_at=START,
        updated_at=START,
        predicted_at=START + timedelta(seconds=8),
        time_to_conflict_s=8.0,
        location=Location(datum="5f1d0000-0000-4000-8000-00000000000a", x=1.0, y=2.0),
        summary="they wait for each other in aisle 4 in 8 s",
        cycle=tuple(Wait(waiter=a, holder=b, where="aisle-4", from_at=START) for a, b in ring),
    )


def situation(number: int, revision: int = 1, **fields: Any) -> Situation:
    """A revision of the situation with this number: the two robots of `made` meet."""
    updated_at = START + timedelta(minutes=number, seconds=revision - 1)
    wait = Action(robot=ROBOTS[0], name="Tug 1", action="wait", seconds=3.0)
    whole: dict[str, Any] = {
        "id": f"situation-{number}",
        "revision": revision,
        "state": AdvisoryState.RAISED if revision == 1 else AdvisoryState.UPDATED,
        "severity": Severity.WARNING,
        "situation_kind": "meeting",
        "robots": ROBOTS,
        "names": ("Tug 1", "Lift 2"),
        "vendors": ("Acme", "Borealis"),
        "raised_at": START + timedelta(minutes=number),
        "updated_at": updated_at,
        "predicted_at": updated_at + timedelta(seconds=4.25),
        "time_to_conflict_s": 4.25,
        "location": Location(datum="5f1d0000-0000-4000-8000-00000000000a", x=1.0, y=2.0),
        "summary": "Tug 1 and Lift 2 meet at the dock",
        "advice": SituationAdvice(actions=(wait,), text="Tug 1 waits 3 s", since_at=START),
        "outline": ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)),
        "since_at": START,
        "ends": "one of them brakes",
        "cost_s": 5.0,
        "preventable_s": 4.0,
        "advisories": (f"advisory-{number}",),
    }
    return Situation(**(whole | fields))


def cleared_situation(number: int, revision: int = 2, **fields: Any) -> Situation:
    """The revision that clears the situation with this number."""
    when = START + timedelta(minutes=number, seconds=revision - 1)
    ended = {"state": AdvisoryState.CLEARED, "cleared_at": when, "cleared_because": "they passed", "advice": None}
    return situation(number, revision, **(ended | fields))


def made_advice(number: int, **fields: Any) -> RobotAdvice:
    """Robot 1 of Acme is asked to drive around robot 2 of Borealis."""
    whole: dict[str, Any] = {
        "id": f"advice-{number}",
        "revision": 1,
        "state": AdvisoryState.RAISED,
        "severity": Severity.CAUTION,
        "robots": ROBOTS,
        "names": ("Tug 1", "Lift 2"),
        "vendors": ("Acme", "Borealis"),
        "raised_at": START,
        "updated_at": START,
        "predicted_at": START,
        "time_to_conflict_s": 0.0,
        "location": Location(datum="5f1d0000-0000-4000-8000-00000000000a", x=1.0, y=2.0),
        "summary": "Tug 1 should drive around Lift 2, within 20 s",
        "robot": ROBOTS[0],
        "vendor": "Acme",
        "verb": "go_around",
        "other": ROBOTS[1],
        "until": (ROBOTS[1],),
        "latest_at": START + timedelta(seconds=20),
    }
    return RobotAdvice(**(whole | fields))
