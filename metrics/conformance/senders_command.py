"""The command that watches a running service's ports for a while and says, vendor by vendor, what to mend."""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from deconflict.roles.processes.running_service import ADDRESS, add_service_options, service_client
from deconflict.runtime.command_parsers import LONGEST_S, MISUSED, Commands, add_command, number_in
from deconflict_client.counted_nouns import count_of
from deconflict_client.participant_kinds import counted
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.visible_text import visible, visible_lines
from metrics.replay.conformance_counts import value_in_words

if TYPE_CHECKING:
    import httpx

Document = dict[str, Any]
MOST_LINES, MOST_VALUES = 20, 3
"""Of a vendor, and values of a rejected message."""


@dataclass(frozen=True, slots=True)
class Answers:
    """What the API says at one moment."""

    vendors: Mapping[str, Document]
    """By name, as `GET /vendors`."""
    robots: Sequence[Document]
    """As `GET /robots`."""
    rejected: Sequence[Document]
    """As `GET /quarantine`, newest first."""
    health: Document
    """As `GET /healthz`."""
    expected: frozenset[str] = frozenset()
    """The vendors of the site file."""


@dataclass(frozen=True, slots=True)
class WatchedVendor:
    """What one vendor did in the time between."""

    name: str
    standards: str
    messages: int
    rejected: int
    """How many of them."""
    heard: int
    """Robots of it that are heard."""
    kinds: str
    """The same in words, with what they stand for."""
    placed: int
    compared: int
    to_mend: tuple[str, ...]
    """One line for each thing."""


def watched(before: Answers, after: Answers, seconds: float) -> list[WatchedVendor]:
    """The vendors of the site file and those that have sent something, by name."""
    names = {*after.expected, *after.vendors}
    seen = [_vendor(name, before, after, seconds) for name in sorted(names)]
    return [vendor for vendor in seen if vendor.messages or vendor.heard or vendor.to_mend]


def broker_notes(after: Answers) -> list[str]:
    """Topics of brokers that look like those of robots and are not heard, and what to set."""
    return [*after.health.get("brokers", {}).get("notes", ())]


def page(vendors: Sequence[WatchedVendor], notes: Sequence[str], seconds: float) -> str:
    """The result as text for a person."""
    return "".join(f"{visible(line)}\n" for line in _lines(vendors, notes, seconds))


def _lines(vendors: Sequence[WatchedVendor], notes: Sequence[str], seconds: float) -> Iterator[str]:
    for vendor in vendors:
        speaks = f" ({vendor.standards})" if vendor.standards else ""
        robots = f"{vendor.kinds} heard, {vendor.placed} placed, {vendor.compared} compared"
        rejected = f", {vendor.rejected} rejected" if vendor.rejected else ""
        yield f"{vendor.name}{speaks}: {count_of(vendor.messages, 'message')} in {seconds:g} s{rejected}; {robots}"
        yield from (f"  {line}" for line in vendor.to_mend[:MOST_LINES])
        if (more := len(vendor.to_mend) - MOST_LINES) > 0:
            yield f"  and {more} more: GET /vendors and GET /robots have all"
    yield from notes
    things = sum(len(vendor.to_mend) for vendor in vendors) + len(notes)
    if not vendors:
        yield f"no vendor has sent anything in {seconds:g} s"
    yield f"{things} to mend" if things else "nothing to mend" if vendors else "connect the robots, see docs/access.md"


def _vendor(name: str, before: Answers, after: Answers, seconds: float) -> WatchedVendor:
    was, now = before.vendors.get(name, {}), after.vendors.get(name, {})
    messages = _more(was.get("messages", 0), now.get("messages", 0))
    heard = [robot for robot in after.robots if robot["vendor"] == name and robot["age_s"] <= max(seconds, 60.0)]
    lines = [*_rejections(name, was, now, after.rejected), *_uncompared(now, heard), *_odd_values(was, now)]
    if not messages:
        lines.append(
            f"no message of {name} has come in {seconds:g} s: is it connected? GET /healthz and docs/access.md"
        )
    return WatchedVendor(
        name,
        ", ".join(FRONT_ENDS[language].standard for language in now.get("languages", ()) if language in FRONT_ENDS),
        messages,
        _risen(was, now, "rejections_by_rule").total(),
        len(heard),
        counted(robot.get("participant", "robot") for robot in heard),
        sum(robot["location"] is not None for robot in heard),
        sum(robot["compared"] for robot in heard),
        tuple(lines),
    )


def _uncompared(now: Document, heard: Sequence[Document]) -> Iterator[str]:
    """The robots that are compared with nobody until somebody mends something."""
    faulty = {robot["uuid"]: robot for robot in now.get("not_compared", ()) if robot["fault"]}
    waiting = {robot["uuid"]: robot for robot in heard if not robot["compared"] and not robot["examined"]}
    for uuid, robot in (waiting | faulty).items():
        reason = robot.get("reason") or waiting[uuid]["not_compared_reason"]
        yield f"{robot['name']} is compared with nobody: {reason}"


def _odd_values(was: Document, now: Document) -> Iterator[str]:
    """What deviates: the values that are named, then the rules of which no value is."""
    known = {(value["rule"], value["path"]): value["count"] for value in was.get("odd_values", ())}
    named = set()
    for value in now.get("odd_values", ()):
        if count := _more(known.get((value["rule"], value["path"]), 0), value["count"]):
            named.add(value["rule"])
            yield f"{count} x {value['rule']}: {value_in_words(value)}"
    for rule, count in _risen(was, now, "deviations_by_rule").items():
        if rule not in named:
            yield f"{count} x {rule}: {_meaning(rule, now.get('languages', ()))}"


def _rejections(name: str, was: Document, now: Document, rejected: Sequence[Document]) -> Iterator[str]:
    for rule, count in _risen(was, now, "rejections_by_rule").items():
        examples = (row for row in rejected if (row["vendor"], row["rule"]) == (name, rule))
        example = next(examples, None)
        reason = example["reason"] if example else _meaning(rule, now.get("languages", ()))
        yield f"{count} x rejected, {rule}: {reason}"
        for odd in (example or {}).get("odd_values", ())[:MOST_VALUES]:
            yield f"  {value_in_words(odd)}"


def _risen(was: Document, now: Document, key: str) -> Counter[str]:
    """By rule, how many more there are, the most first."""
    before = was.get(key, {})
    risen = {rule: _more(before.get(rule, 0), count) for rule, count in now.get(key, {}).items()}
    return Counter(dict(sorted(((rule, more) for rule, more in risen.items() if more), key=lambda row: -row[1])))


def _more(was: int, now: int) -> int:
    """How many came between. A service that was started anew counts from 0."""
    return now - was if now >= was else now


def _meaning(rule: str, languages: Sequence[str]) -> str:
    spoken = (FRONT_ENDS[language].rules for language in (*languages, *FRONT_ENDS) if language in FRONT_ENDS)
    return next((rules[rule].sentence for rules in spoken if rule in rules), "see GET /quarantine")


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
