"""Why a robot stands, as far as its reports say it."""

from deconflict.contention.robots.robot_view import RobotView

STATE_PHRASES = {
    "waitingHumanEvent": "waits for a person",
    "waitingExternalEvent": "waits for something around it",
    "waitingInternalEvent": "busy with itself",
    "navigating": "says that it drives",
    "manualOverride": "driven by hand",
}
"""Phrases for states of the standard (5.2); other states are words already."""
NEEDS_PERSON = frozenset(("disabled", "offline", "manualOverride"))
"""States of a robot that a person has to move."""


def needs_person(robot: RobotView, quiet_after_s: float, now_s: float) -> bool:
    """Whether only a person can say when a standing robot moves on."""
    return robot.state in NEEDS_PERSON or now_s - robot.event_s >= quiet_after_s


def state_phrase(robot: RobotView, quiet_after_s: float, now_s: float) -> str:
    """The state of a standing robot, in words."""
    age_s = now_s - robot.event_s
    if age_s >= quiet_after_s:
        return f"last heard {age_s:.0f} s ago"
    return STATE_PHRASES.get(robot.state, robot.state) or "no state"
