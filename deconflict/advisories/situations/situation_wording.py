"""The sentences of a situation: what is going on, and how it ends. Pure."""

from collections.abc import Iterable, Mapping, Sequence

from deconflict.advice.document_limits import MOST_SUMMARY_BYTES, short_text
from deconflict.advisories.situations.situation import SituationKind
from deconflict.advisories.situations.situation_kinds import Matter
from deconflict.advisory import AnyAdvisory, BlockageAdvisory, ContentionAdvisory

MOST_NAMED = 4
"""Robots that a sentence names."""
ENDS: dict[SituationKind, str] = {
    "meeting": "by itself, once they have passed each other",
    "head_on": "once one of them makes way for the other",
    "knot": "by itself, once they have passed one after another",
    "queue": "once those that are there leave",
    "crowd": "once they report from their true places",
    "blocked_aisle": "once {culprit} moves on",
    "obstacle": "once {culprit} moves on, or the others have passed it",
    "silent_robot": "once {culprit} reports again, or somebody has found it",
    "deadlock": "not by itself: somebody must move one of them",
    "identity": "once each robot is reported by its own vendor, from one place",
}


def names_of(advisories: Iterable[AnyAdvisory]) -> dict[str, str]:
    """The names of all robots of some advisories, by UUID in ascending order."""
    names = {
        robot: name for advisory in advisories for robot, name in zip(advisory.robots, advisory.names, strict=True)
    }
    return dict(sorted(names.items()))


def sentence(matter: Matter, names: Mapping[str, str], left_s: float, place: str) -> str:
    """What is going on, for a person. The first event begins in `left_s`; `place` is a phrase such as "in Aisle 3 on
    Ground hall"."""
    return short_text(_sentence(matter, names, left_s, place), MOST_SUMMARY_BYTES)


def ending(matter: Matter, names: Mapping[str, str]) -> str:
    """How it ends if nobody does anything, for a person."""
    return ENDS[matter.kind].format(culprit=names.get(matter.culprit or "", "it"))


def _sentence(matter: Matter, names: Mapping[str, str], left_s: float, place: str) -> str:
    principal, when = matter.principal, _when(left_s)
    others = _named([name for robot, name in names.items() if robot != matter.culprit])
    culprit = names.get(matter.culprit or "", "")
    match matter.kind:
        case "knot":
            return f"{len(names)} robots get in each other's way {when}, {place}: {others}"
        case "obstacle":
            return f"{culprit} stands in the way of {others}, {place}"
        case "silent_robot":
            return f"{culprit} is silent, and {others} will come to its place {when}, {place}"
        case "blocked_aisle" if isinstance(principal, BlockageAdvisory):
            held_up = _named([names.get(robot, robot) for robot in principal.holds_up])
            stood_s = (principal.updated_at - principal.since_at).total_seconds()
            return f"{culprit} has stood for {stood_s:.0f} s {place}, in the way of {held_up}"
        case "queue" if isinstance(principal, ContentionAdvisory):
            return _queue(principal, names)
    return principal.summary.split(";")[0]


def _queue(contention: ContentionAdvisory, names: Mapping[str, str]) -> str:
    label, count = contention.resource_name, contention.queue_length
    if contention.kind == "double_occupancy" or not count:
        return contention.summary.split(";")[0]
    waiting = "1 robot waits" if count == 1 else f"{count} robots wait"
    return f"{waiting} for {label}, up to {contention.wait_s:.0f} s: {_named(list(names.values()))}"


def _named(names: Sequence[str]) -> str:
    """At most `MOST_NAMED` names, as a list in a sentence."""
    more = len(names) - MOST_NAMED
    shown = [*names[:MOST_NAMED], f"{more} more"] if more > 0 else list(names)
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else "".join(shown)


def _when(left_s: float) -> str:
    return f"in {left_s:.0f} s" if left_s >= 1 else "now"
