"""Actions of people in words, and how fast people react."""

from deconflict_client.advisory import Action

FIND_CAUSE = "see whether it is blocked or stopped by a fault, and clear the way or restart it"
DRIVE_ASIDE = "drive it aside by hand, so that the others can pass"
DRIVE_ON = "drive it on by hand"


PERSON_REACTION_S = 3.0
"""The shortest useful reaction of a person."""
SHORTEST_WAIT_S = 3.0
"""Nobody can have a robot wait for a shorter time."""


def action_text(action: Action) -> str:
    """What one robot should do, or what a person should look at, for people."""
    name, where = action.name, f" {action.where}" if action.where else ""
    seconds = f" for {action.seconds:g} s" if action.seconds else ""
    match action.action:
        case "wait":
            return f"{name} should wait{seconds.removeprefix(' for')}{where}"
        case "slow_down":
            return f"{name} should slow down to {action.speed_mps or 0.0:g} m/s{seconds}"
        case "take_another_route":
            return f"{name} should go{where}" if action.resource else f"{name} should take another route{where}"
        case "back_out":
            return f"{name} should back out{where}"
        case "go_first":
            return f"{name} should go first"
        case "look":
            task = f" and {action.task}" if action.task else ""
            return f"somebody should go to {name}{f' ({action.reason})' if action.reason else ''}{task}"
