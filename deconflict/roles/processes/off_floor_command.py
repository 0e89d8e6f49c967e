"""The command that says to a running service that a robot is off the floor, or puts it back."""

import argparse
import getpass
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from deconflict.roles.processes.running_service import add_service_options, service_client
from deconflict.runtime.command_parsers import MISUSED, Commands, add_command
from ingest.languages.visible_text import visible_lines

if TYPE_CHECKING:
    import httpx

MOST_NAMED = 5


def add_off_floor(commands: Commands) -> None:
    """Add the command to the command line."""
    command = add_command(
        commands,
        "off-floor",
        "say to a running service that a robot is off the floor, until it is heard elsewhere",
        "deconflict off-floor 'Alder A-1'",
        "deconflict off-floor 'Alder A-1' --back      # it is on the floor after all",
        "deconflict off-floor UUID https://floor.example:8080 --token env:DECONFLICT_TOKEN",
    )
    command.add_argument("robot", metavar="ROBOT", help="its name as the page shows it, or its UUID")
    add_service_options(command)
    command.add_argument("--back", action="store_true", help="put the robot back on the floor")
    command.add_argument("--name", help="who says so; whose token it is, or else the user of this machine")
    command.set_defaults(run=_off_floor)


def _off_floor(args: argparse.Namespace) -> int:
    """0 once the service has it, 2 if it does not."""
    import httpx  # noqa: PLC0415 - the command line starts without it

    try:
        with service_client(args) as http:
            uuid, name = _robot(http, args.robot)
            body = {"off_floor": not args.back, "name": args.name or _user()}
            answer = _answer(http.post(f"/robots/{uuid}/off-floor", json=body))
    except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError) as error:
        sys.stderr.write(f"deconflict: {visible_lines(f'{args.url}: {error}')}\n")
        return MISUSED
    state = f"is off the floor, says {answer['by']}" if answer["off_floor"] else "is on the floor"
    sys.stdout.write(visible_lines(f"{name} {state}") + "\n")
    return 0


def _robot(http: "httpx.Client", wanted: str) -> tuple[str, str]:
    """The UUID and the name of a robot. Raises `ValueError` if none has that name."""
    robots = _answer(http.get("/robots"))["robots"]
    names = {robot["uuid"]: robot["name"] for robot in robots}
    if wanted.lower() in names:
        return wanted.lower(), names[wanted.lower()]
    found = [uuid for uuid, name in names.items() if name.casefold() == wanted.casefold()]
    if len(found) == 1:
        return found[0], names[found[0]]
    near = sorted(name for name in names.values() if wanted.casefold() in name.casefold())[:MOST_NAMED]
    if found:
        raise ValueError(f"several robots have the name {wanted!r}; give the UUID of one: {', '.join(found)}")
    raise ValueError(f"no robot has the name or UUID {wanted!r}" + (f"; like it: {', '.join(near)}" if near else ""))


def _answer(answer: "httpx.Response") -> dict[str, Any]:
    """Raises `ValueError` with what the service says, if it refuses."""
    try:
        document: dict[str, Any] = answer.json()
        detail = document.get("detail", "")
    except (ValueError, AttributeError) as error:
        raise ValueError("it does not answer as the service does; give the address of its operators' port") from error
    if answer.is_error:
        raise ValueError(f"{answer.status_code}, {detail}")
    return document


def _user() -> str:
    with suppress(OSError, KeyError):
        return getpass.getuser()
    return "somebody at the command line"
