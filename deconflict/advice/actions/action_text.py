"""Actions in words."""

from deconflict_client.advisory import Action


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
