"""Why a robot stands, as far as its reports say it, and what a person does about it there."""

from deconflict.advice.actions.action_text import FIND_CAUSE
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
TASKS = {
    "waitingHumanEvent": "do what it asks for",
    "disabled": "see what has stopped it, and switch it on again or drive it aside by hand",
    "offline": "switch it on again or push it aside",
    "manualOverride": "have whoever drives it by hand move it aside",
}
"""What a person does at a robot in such a state."""
SILENT_TASK = "see whether it is switched on, and restart it or push it aside"


def needs_person(robot: RobotView, quiet_after_s: float, now_s: float) -> bool:
    """Whether only a person can say when a standing robot moves on."""
    return robot.state in NEEDS_PERSON or is_silent(robot, quiet_after_s, now_s)


def is_silent(robot: RobotView, quiet_after_s: float, now_s: float) -> bool:
    """Whether a robot has not been heard lately."""
    return now_s - robot.event_s >= max(quiet_after_s, robot.reports_within_s)


def task_at(robot: RobotView, is_quiet: bool) -> str:
    """What a person does at a standing robot; `is_quiet` if it is silent."""
    return SILENT_TASK if is_quiet else TASKS.get(robot.state, FIND_CAUSE)


def state_phrase(robot: RobotView, quiet_after_s: float, now_s: float) -> str:
    """The state of a standing robot, in words."""
    if is_silent(robot, quiet_after_s, now_s):
        return f"last heard {now_s - robot.event_s:.0f} s ago"
    return STATE_PHRASES.get(robot.state, robot.state) or "no state"
