"""The command that watches a running service's ports for a while and says, vendor by vendor, what to mend."""

import argparse
import sys
import time
from typing import TYPE_CHECKING, Any

from deconflict.roles.processes.running_service import ADDRESS, add_service_options, service_client
from deconflict.runtime.command_parsers import LONGEST_S, MISUSED, Commands, add_command, number_in
from ingest.languages.visible_text import visible_lines
from metrics.conformance.watched_senders import Answers, broker_notes, page, watched

if TYPE_CHECKING:
    import httpx

TO_MEND = 1
"""Exit code if something is to be mended."""
LEAST_S = 0.1


def add_senders(commands: Commands) -> None:
    """Add the command to the command line."""
    command = add_command(
        commands,
        "senders",
        "watch what a running service hears for a minute, and say vendor by vendor what is to be mended",
        "deconflict senders",
        "deconflict senders https://floor.example:8080 --token env:DECONFLICT_TOKEN --seconds 20",
    )
    add_service_options(command)
    command.add_argument(
        "--seconds",
        type=number_in(LEAST_S, LONGEST_S),
        default=60.0,
        metavar="S",
        help="how long to watch (default: %(default)g)",
    )
    command.set_defaults(run=_senders)


def _senders(args: argparse.Namespace) -> int:
    """0 if nothing is to be mended, 1 if something is, 2 if the service does not answer."""
    import httpx  # noqa: PLC0415 - the command line starts without it

    try:
        with service_client(args) as http:
            before = _answers(http)
            sys.stderr.write(f"watching {args.url} for {args.seconds:g} s\n")
            time.sleep(args.seconds)
            after = _answers(http)
    except (httpx.HTTPError, httpx.InvalidURL, OSError, ValueError) as error:
        assumed = " (asked since no URL was given)" if args.url == ADDRESS else ""
        problem = f"{args.url}{assumed} does not answer as the service does: {error}; give the address of its "
        problem += "operators' port, as `deconflict senders URL`"
        sys.stderr.write(f"deconflict: {visible_lines(problem)}\n")
        return MISUSED
    vendors, notes = watched(before, after, args.seconds), broker_notes(after)
    sys.stdout.write(page(vendors, notes, args.seconds))
    return TO_MEND if notes or not vendors or any(vendor.to_mend for vendor in vendors) else 0


def _answers(http: "httpx.Client") -> Answers:
    """What the API says now. Raises `httpx.HTTPError` or `ValueError` if it is not that of the service."""
    health = http.get("/healthz")  # 503 has the same document
    if health.status_code in (401, 403):
        raise ValueError(f"{health.status_code}, the token may not read; set --token")
    return Answers(
        vendors={vendor["name"]: vendor for vendor in _listed(http, "/vendors", "vendors")},
        robots=_listed(http, "/robots", "robots"),
        rejected=_listed(http, "/quarantine", "rejected"),
        health=health.json(),
        expected=frozenset(vendor["name"] for vendor in _listed(http, "/site", "vendors")),
    )


def _listed(http: "httpx.Client", path: str, key: str) -> list[dict[str, Any]]:
    answer = http.get(path)
    answer.raise_for_status()
    try:
        rows: list[dict[str, Any]] = answer.json()[key]
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path} has no {key}") from error
    return rows
