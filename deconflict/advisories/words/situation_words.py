"""The sentences of a situation: what is going on, how it ends, and what it was. Pure."""

from collections.abc import Iterable, Mapping, Sequence
from math import ceil
from typing import NamedTuple

from deconflict.advisories.words.conflict_wording import ENCOUNTER_VERBS
from deconflict.advisories.words.words import RevisionWords, each_waits, words
from deconflict_client.advisory import (
    AnyAdvisory,
    BlockageAdvisory,
    ConflictAdvisory,
    ContentionAdvisory,
    DeadlockAdvisory,
    SituationKind,
)
from deconflict_client.counted_nouns import count_of
from deconflict_client.participant_kinds import ParticipantKind, counted_in_words

MOST_NAMED = 4
"""Robots that a sentence names."""
ORDINALS = dict(enumerate(["second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth"], 2))
TWICE = 2
LONG_S = 100.0
"""From here on times are given in minutes."""
STOOD_S = (10, 20, 30, 60, 120, 300, 600, 1800, 3600)
"""How long a robot has stood is given by the longest of these that is over: that stays true until the next revision."""
ENDS: dict[SituationKind, str] = {
    "meeting": "by itself, once they have passed each other",
    "head_on": "once one of them makes way for the other",
    "knot": "by itself, once they have passed one after another",
    "queue": "once those that are there leave",
    "crowd": "once they report from their true places",
    "blocked_aisle": "once {culprit} moves on",
    "obstacle": "once {culprit} moves on, or the others have passed it",
    "silent_robot": "once {culprit} reports again, or somebody has found it",
    "deadlock": "once one of them makes way",
    "identity": "once each robot is reported by its own vendor, from one place",
}


class Matter(NamedTuple):
    """What is going on, and the advisory that says most about it."""

    kind: SituationKind
    principal: AnyAdvisory
    advisories: tuple[AnyAdvisory, ...]
    """Those that are about it."""
    culprit: str | None
    """UUID of the robot that stands or is silent in the way of the others; None if there is no such robot."""


class Involved(NamedTuple):
    """Who is in a situation."""

    name: str
    kind: ParticipantKind = "robot"


def names_of(advisories: Iterable[AnyAdvisory]) -> dict[str, str]:
    """The names of all robots of some advisories, by UUID in ascending order."""
    names = {
        robot: name for advisory in advisories for robot, name in zip(advisory.robots, advisory.names, strict=True)
    }
    return dict(sorted(names.items()))


def present_words(
    matter: Matter, parties: Sequence[Involved], now_s: float, place: str, spots: int, again: str
) -> RevisionWords:
    """What is going on, for a person, at so many `spots`. `parties` are all in the situation.

    `place` is a phrase such as "in Aisle 3 on Ground hall".
    """
    left_s = min(advisory.time_left_s(now_s) for advisory in matter.advisories)

    def sentence(when: str) -> str:
        if matter.kind == "knot":
            return f"{_knot(parties, when, spots)}, {'the worst ' * (spots > 1)}{place}{again}"
        return _sentence(matter, when, now_s, place) + again

    return words(sentence, f" {_when(left_s)}")


def again_text(times: int, within_s: float, longest_s: float | None) -> str:
    """How often it has been there, as the end of a sentence; and within how long it ended, if that was by itself."""
    text = f"; {ORDINALS.get(times, f'{times}th')} time in {within_s / 60:.0f} min"
    if longest_s is None:
        return text
    before = "each time before" if times > TWICE else "the first time"
    return f"{text}, ended by itself within {max(ceil(longest_s), 1)} s {before}"


def ending(matter: Matter, names: Mapping[str, str]) -> str:
    """How it ends if nobody does anything, for a person."""
    return ENDS[matter.kind].format(culprit=names.get(matter.culprit or "", "it"))


PAST: dict[SituationKind, str] = {
    "meeting": "{names} got in each other's way, or were about to",
    "head_on": "{names} met head-on, or were about to",
    "knot": "{all} got in each other's way",
    "queue": "robots needed the same place",
    "crowd": "{all} reported from one point",
    "blocked_aisle": "{culprit} stood in the way of others",
    "obstacle": "{culprit} stood in the way of {names}",
    "silent_robot": "{culprit} was silent in the way of {names}",
    "deadlock": "{names} waited for each other, or were about to",
    "identity": "{all} {were} reported by another vendor, or from two places",
}


def past_words(
    kind: SituationKind, parties: Mapping[str, Involved], more: int, culprit: str | None, place: str
) -> RevisionWords:
    """What was going on in a situation that is over, for a person. `parties` are by UUID, `more` are not among them.

    Whom a robot held up is named if it was one. Of several, some may only have met each other.
    """
    others = [party.name for robot, party in parties.items() if robot != culprit]
    is_known = culprit is None or len(others) + more == 1
    by = parties[culprit].name if culprit and culprit in parties else "a robot"
    were = "were" if len(parties) + more > 1 else "was"
    past = PAST[kind].format(
        names=_named(others, more) if is_known else "others",
        culprit=by,
        all=_counted(parties.values(), more),
        were=were,
    )
    return words(lambda _: ", ".join(filter(None, [past, place])))


def _knot(parties: Sequence[Involved], when: str, spots: int) -> str:
    """`when` is empty in a headline, which does not list the robots."""
    at = f" at {spots} places" if spots > 1 else ""
    listed = f": {_named([party.name for party in parties])}" if when else ""
    return f"{_counted(parties)} get in each other's way{at}{when}{listed}"


def _counted(parties: Iterable[Involved], more: int = 0) -> str:
    """How many robots and people they are, and how many more of which that is not known."""
    counted = counted_in_words(party.kind for party in parties)
    return f"{counted}, and {more} more" if more else counted


def _sentence(matter: Matter, when: str, now_s: float, place: str) -> str:
    """`when` begins with a space; it is empty in a headline."""
    principal = matter.principal
    match principal:
        case ConflictAdvisory():
            return f"{_conflict(matter, principal, when)}, {place}"
        case BlockageAdvisory():
            names = names_of([principal])
            held_up = _named([names.get(robot, robot) for robot in principal.holds_up])
            stood = _stood(now_s - principal.since_at.timestamp())
            return f"{names[principal.blocker]} has stood {stood}, {place}, in the way of {held_up}"
        case DeadlockAdvisory():
            ring = list(names_of([principal]).values())
            return f"{_named(ring)} lock each other{when}, {place}: {each_waits(len(ring))}"
        case ContentionAdvisory(kind="contention") if principal.queue_length:
            return _queue(principal, when)
    return principal.headline or principal.summary


def _conflict(matter: Matter, principal: ConflictAdvisory, when: str) -> str:
    names = names_of(matter.advisories)
    others = _named([name for robot, name in names.items() if robot != matter.culprit])
    culprit = names.get(matter.culprit or "", "")
    match matter.kind:
        case "obstacle":
            return f"{culprit} stands in the way of {others}{when}"
        case "silent_robot":
            return f"{culprit} is silent, and {others} come to its place{when}"
    return f"{others} {ENCOUNTER_VERBS[principal.encounter_class]}{when}"


def _queue(contention: ContentionAdvisory, when: str) -> str:
    label, count = contention.resource_name, contention.queue_length
    robots = count_of(count, "robot")
    if contention.resources:
        wait = f"{robots} will probably have to wait for {label}{when}"
    else:
        wait = f"{robots} {'has' if count == 1 else 'have'} to wait for {label}{when}"
    needed = "one" if contention.resources else "it"
    all_robots = count_of(len(contention.robots), "robot needs", "robots need")
    return f"{wait}, up to {contention.wait_s:.0f} s; {all_robots} {needed}"


def _stood(stood_s: float) -> str:
    """How long a robot has stood at least."""
    longest_s = max((step_s for step_s in STOOD_S if step_s <= stood_s), default=0)
    if not longest_s:
        return "for some seconds"
    return f"for over {longest_s} s" if longest_s < LONG_S else f"for over {longest_s // 60} min"


def _named(names: Sequence[str], left_out: int = 0) -> str:
    """At most `MOST_NAMED` names, as a list in a sentence. `left_out` are more robots that have no names here."""
    more = max(len(names) - MOST_NAMED, 0) + left_out
    shown = [*names[:MOST_NAMED], f"{more} more"] if more > 0 else list(names)
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else "".join(shown)


def _when(left_s: float) -> str:
    if left_s < 1:
        return "now"
    return f"in {left_s:.0f} s" if left_s < LONG_S else f"in {left_s / 60:.0f} min"
