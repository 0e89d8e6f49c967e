"""What a release decides over one log: the output of `deconflict replay`, as one line for each decision.

A decision is a key and a value. Keys name no internal part, and the values are those that users get:

- a revision of an advisory: its kind, its robots or place, which time, when -> state, severity, probabilities
- the advice of such a revision: who is to wait for how long, and who has which slot
- a revision of a situation: its robots when it was raised, when -> state, kind, severity, number of advisories, advice
- a pair that was worth a look: in how many seconds it was, and the mean of its probabilities
- lost time: each figure of the whole, by vendors and by place
"""

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from deconflict.__main__ import parser

Decisions = dict[str, str]
PLACE_OF_KIND = {"contention": "resource", "double_occupancy": "resource", "blockage": "blocker"}
"""The field that names what an advisory is about, where that is not its robots."""


def decided(log: Path, site: Path | None, clearance_m: float | None = None) -> tuple[Decisions, dict[str, Any]]:
    """What this release decides over a log, and its scores. The command runs in this process."""
    with TemporaryDirectory(prefix="decisions-") as folder:
        names = ("advisories", "situations", "probabilities", "json")
        outputs = {name: Path(folder) / name for name in names}
        options = [option for name, path in outputs.items() for option in (f"--{name}", str(path))]
        options += ["--site", str(site)] if site else []
        options += ["--clearance", str(clearance_m)] if clearance_m is not None else []
        args = parser().parse_args(["replay", str(log), "--jobs", "1", *options])
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            args.run(args)
        result = json.loads(outputs["json"].read_text())
        found = (
            *_of_advisories(_lines(outputs["advisories"])),
            *_of_situations(_lines(outputs["situations"])),
            *_of_pairs(_lines(outputs["probabilities"])),
            *_of_losses(result["losses"]),
        )
    decisions: Decisions = {}
    for key, value in found:
        decisions[key] = f"{decisions[key]}; {value}" if key in decisions else value
    return decisions, result


def scores(result: Mapping[str, Any]) -> dict[str, Any]:
    """The few scores that say whether its warnings are as good as before."""
    names = ("encounters", "recall", "recall_any", "alerts", "precision", "ece")
    of_situations = {f"situations_{name}": result["situations"][name] for name in ("situations", "came_true")}
    return {name: result["scores"][0][name] for name in names} | of_situations


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    with path.open(encoding="utf-8") as lines:
        yield from map(json.loads, lines)


def _of_advisories(revisions: Iterator[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    subjects: dict[str, str] = {}
    times: defaultdict[str, int] = defaultdict(int)
    for revision in revisions:
        if revision["id"] not in subjects:
            subject = revision.get(PLACE_OF_KIND.get(revision["kind"], "")) or " ".join(revision["robots"])
            matter = f"{revision['kind']} {subject}"
            times[matter] += 1
            subjects[revision["id"]] = f"{matter} #{times[matter]}"
        key = f"{subjects[revision['id']]} at {revision['updated_at']}"
        fields = (revision["state"], revision["severity"])
        figures = (revision.get("probability"), revision.get("contact_probability"), revision.get("min_separation_m"))
        yield key, " ".join([*fields, *map(str, figures)])
        if advice := _advice(revision["recommendation"]):
            yield f"advice of {key}", advice


def _advice(recommendation: dict[str, Any] | None) -> str:
    if not recommendation:
        return ""
    holds = [f"{hold['robot']} waits {hold['hold_s']}" for hold in recommendation["holds"]]
    slots = [f"{slot['robot']} has {slot['resource']} after {slot['wait_s']}" for slot in recommendation["slots"]]
    return ", ".join(holds + slots)


def _of_situations(revisions: Iterator[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    subjects: dict[str, str] = {}
    for revision in revisions:
        raised = f"situation {' '.join(revision['robots'])} from {revision['raised_at']}"
        key = f"{subjects.setdefault(revision['id'], raised)} at {revision['updated_at']}"
        advisories = len(revision["advisories"]) + revision["more_advisories"]
        actions = [f"{action['robot']} {action['action']}" for action in (revision["advice"] or {}).get("actions", ())]
        fields = (revision["state"], revision["situation_kind"], revision["severity"], str(advisories))
        yield key, " ".join([*fields, *actions])


def _of_pairs(seconds: Iterator[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    looks: defaultdict[str, int] = defaultdict(int)
    sums: defaultdict[str, float] = defaultdict(float)
    for second in seconds:
        for first, other, probability in second["pairs"]:
            looks[f"pair {first} {other}"] += 1
            sums[f"pair {first} {other}"] += probability
    yield from ((pair, f"{count} looks {sums[pair] / count:.9f}") for pair, count in looks.items())


def _of_losses(losses: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "lost in all", _figures(losses["total"])
    for row in losses["by_vendors"]:
        yield f"lost by {row['vendor']} to {row['by']}", _figures(row)
    for row in losses["by_place"]:
        where = {name: value for name, value in row.items() if isinstance(value, str)}
        yield f"lost at {json.dumps(where, sort_keys=True)}", _figures(row)


def _figures(row: Mapping[str, Any]) -> str:
    return " ".join(f"{name}={row[name]}" for name in ("losses", "lost_s", "sure_s", "warned_s", "heeded_s"))
