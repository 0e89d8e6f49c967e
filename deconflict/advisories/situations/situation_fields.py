"""The fields of a situation's revisions. Whether a revision is due, others decide. Pure.

Where its advisories are is one shape: spots, with thin links between those far apart.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely

from deconflict.advice.document_limits import MOST_NAME_BYTES, short_text
from deconflict.advisories.severity import SEVERITIES
from deconflict.advisories.situations.advice.action_sets import Proposal, key_of, proposal_of
from deconflict.advisories.situations.advice.recurrences import BY_ITSELF_S, WITHIN_S
from deconflict.advisories.situations.advice.situation_advice import revised_advice
from deconflict.advisories.situations.advice.stakes import Stakes
from deconflict.advisories.situations.grouping import Group
from deconflict.advisories.situations.situation_kinds import matter_of
from deconflict.advisories.words.situation_words import (
    Involved,
    Matter,
    again_text,
    ending,
    names_of,
    past_words,
    present_words,
)
from deconflict.advisories.words.words import Spot
from deconflict_client.advisory import (
    AdvisoryState,
    AnyAdvisory,
    ClearedCode,
    ContentionAdvisory,
    NamedPlace,
    Severity,
    SituationKind,
    moment,
)
from deconflict_client.participant_kinds import ParticipantKind
from deconflict_client.situations import (
    MOST_ADVISORIES,
    MOST_CORNERS,
    MOST_ROBOTS,
    PeopleWaitFor,
    Situation,
    SituationAdvice,
)

MARGIN_M, LINK_M = 1.5, 0.2
"""The outline keeps the first distance from the places of the advisories, and the second from a link."""
SPOT_M = 5.0
"""Places that are nearer to each other are of one spot."""
SQUARE_M = SPOT_M / 2**0.5
"""All places in a square of this side are of one spot."""
MOST_LINKED = MOST_CORNERS // 4
"""The outline of more spots mostly has too many corners: each spot has eight, and a link hides few of them."""
Place = tuple[float, float]


def spots(places: Sequence[Place]) -> list[shapely.Geometry]:
    """The convex hull of the places of each spot, in metres: that of a line through them, which is made faster than the
    points. It passes each place twice, since a line has two points at least."""
    at_m, spot = np.array(places, np.float64), np.array(spot_numbers(places))
    twice = np.repeat(np.argsort(spot, kind="stable"), 2)
    return list(shapely.convex_hull(shapely.linestrings(at_m[twice], indices=spot[twice])))


def count_spots(places: Sequence[Place]) -> int:
    """How many spots the places are of."""
    return max(spot_numbers(places), default=-1) + 1


def spot_numbers(places: Sequence[Place]) -> list[int]:
    """The number of the spot of each place, from 0 by their first places."""
    if not places:
        return []
    at_m = np.array(places, np.float64)
    _, square = np.unique(np.floor(at_m / SQUARE_M), axis=0, return_inverse=True)
    order = np.argsort(square, kind="stable")
    squares = shapely.multipoints(at_m[order], indices=square[order])
    beside: dict[int, list[int]] = {number: [] for number in range(len(squares))}
    for number, near in shapely.STRtree(squares).query(squares, predicate="dwithin", distance=SPOT_M).T.tolist():
        beside[number].append(near)
    number_of, spots_so_far = dict[int, int](), 0
    for first in square.tolist():
        if first not in number_of:
            reached = [first]
            while reached:
                at = reached.pop()
                if at not in number_of:
                    number_of[at] = spots_so_far
                    reached += beside[at]
            spots_so_far += 1
    return [number_of[each] for each in square.tolist()]


def outline(group: Group) -> tuple[Place, ...]:
    """Corners of the area around the places of its advisories, in metres; empty without a place."""
    if not group.datum:
        return ()
    places = sorted((member.x_m, member.y_m) for member in group.members.values())
    rings = (shapely.get_exterior_ring(area) for area in _areas(places))
    ring = next(ring for ring in rings if shapely.get_num_coordinates(ring) <= MOST_CORNERS + 1)
    return tuple((x_m, y_m) for x_m, y_m in shapely.get_coordinates(ring)[:-1].round(2).tolist())


def _areas(places: Sequence[Place]) -> Iterator[shapely.Polygon]:
    """Areas around the places, the closest to them first. Only the last one never has too many corners."""
    if len(hulls := spots(places)) <= MOST_LINKED:
        yield _linked(hulls)
    yield _around(shapely.multipoints(places).convex_hull)
    yield _around(shapely.multipoints(places).envelope)


def _around(shape: shapely.Geometry) -> shapely.Polygon:
    return shapely.buffer(shape, MARGIN_M, quad_segs=2)


def _linked(hulls: Sequence[shapely.Geometry]) -> shapely.Polygon:
    """The areas around all spots as one polygon: each is linked to the nearest of those before it."""
    whole = _around(hulls[0])
    left = [*hulls[1:]]
    while left:
        nearest = min(left, key=whole.distance)
        left.remove(nearest)
        area = _around(nearest)
        link = shapely.buffer(shapely.shortest_line(whole, area), LINK_M, cap_style="square")
        whole = shapely.union_all([whole, link, area])
    return whole


NOTHING_LEFT: dict[str, Any] = {"advice": None, "people_wait_for": None, "advisories": (), "more_advisories": 0}
OVER = f"by itself: {ClearedCode.NOTHING_LEFT.because}"
"""How a situation ends whose last advisory has ended."""
MAY_LAST: frozenset[SituationKind] = frozenset(("deadlock", "crowd", "silent_robot"))
"""What does not end by itself, or nobody knows when."""

OF_FEW: frozenset[SituationKind] = frozenset(("meeting", "head_on", "deadlock", "obstacle", "silent_robot"))
"""What is told of the robots of its subject only, once it is over, unless others have taken their place."""


def emptied(before: Situation, spot: Spot, now_s: float) -> Situation:
    """The revision of a situation whose last advisory has ended, until it is cleared."""
    nothing: dict[str, Any] = {"severity": Severity.CAUTION, "preventable_s": None, "cost_s": 0.0, **NOTHING_LEFT}
    texts = {**_past_texts(before, spot), "ends": OVER}
    return before.next_revision(updated_at=moment(now_s), time_to_conflict_s=0.0, **texts, **nothing)


def cleared(before: Situation, code: ClearedCode, spot: Spot, now_s: float) -> Situation:
    """The last revision."""
    texts = _past_texts(before, spot)
    return before.cleared_revision(now_s, code).model_copy(update={**texts, **NOTHING_LEFT})


def _past_texts(before: Situation, spot: Spot) -> dict[str, str]:
    kinds = dict(zip(before.robots, before.participants, strict=False))
    named = zip(before.robots, before.names, strict=True)
    parties, more = {robot: Involved(name, kinds.get(robot, "robot")) for robot, name in named}, before.more_robots
    of_subject = {robot: parties[robot] for robot in before.subject_robots if robot in parties}
    if before.situation_kind in OF_FEW and len(of_subject) > 1:
        parties, more = of_subject, 0
    return past_words(before.situation_kind, parties, more, before.culprit, spot.text)._asdict()


class Assessment(NamedTuple):
    """What the open advisories of a situation come to."""

    advisories: Sequence[AnyAdvisory]
    stakes: Stakes
    matter: Matter
    robots: tuple[str, ...]
    """Those that it lists."""
    possible: SituationAdvice | None
    """What there is to do, whether or not anybody is asked for it now."""
    advice: SituationAdvice | None
    """What is asked for now."""
    severity: Severity
    keeps_sentence: bool
    """Whether its sentence stays as it is, because its advice stands that no advisory asks for any more."""
    people_wait_for: PeopleWaitFor | None = None
    """Why people are not asked yet for what is possible."""


def assessed(
    before: Situation | None,
    possible: SituationAdvice | None,
    advisories: Sequence[AnyAdvisory],
    about: Collection[str],
    robots: tuple[str, ...],
    stakes: Stakes,
    urgency: Severity,
    busy: Collection[str],
    now_s: float,
) -> Assessment:
    """What at least one advisory comes to, after the revision `before` and with what was `possible` then.

    `about` are ids of those that are about its subject, `robots` are those that are listed, and `busy` ones have more
    urgent things to do.
    """
    proposal = proposal_of(advisories, [robot for robot in robots if robot not in busy], now_s, stakes.passing)
    possible = revised_advice(possible, proposal, robots, busy, now_s)
    asking = _asking(proposal, possible)
    on_subject = [advisory for advisory in advisories if advisory.id in about]
    asks = asking if asking in on_subject else None
    matter = matter_of(on_subject, before.situation_kind if before else None, asks)
    severity = min(urgency, _most_severe(matter, possible), key=SEVERITIES.index)
    severity = max(severity, stakes.claim_severity, key=SEVERITIES.index)
    keeps_sentence = possible is not None and possible.for_people and asking is None
    return Assessment(advisories, stakes, matter, robots, possible, possible, severity, keeps_sentence)


def _asking(proposal: Proposal, possible: SituationAdvice | None) -> AnyAdvisory | None:
    """The advisory that asks people for the first action."""
    if possible is None or not possible.for_people:
        return None
    asking = proposal.asked.get(key_of(possible.actions[0]))
    return asking.advisory if asking else None


def _most_severe(matter: Matter, possible: SituationAdvice | None) -> Severity:
    """How severe a situation is at most. What people can do nothing about is a caution; a warning, if it may last.

    Whether they are asked now does not count: it is not less severe while they wait.
    """
    if possible and possible.for_people:
        return Severity.CRITICAL
    return Severity.WARNING if matter.kind in MAY_LAST else Severity.CAUTION


def raised(group: Group, assessment: Assessment, spot: Spot, now_s: float) -> Situation:
    """The first revision. `spot` is where it is."""
    return Situation(
        id=group.id,
        revision=1,
        state=AdvisoryState.RAISED,
        raised_at=moment(now_s),
        since_at=min(advisory.raised_at for advisory in assessment.advisories),
        split_from=group.split_from,
        subject_place=group.subject.place,
        subject_robots=tuple(sorted(group.subject.robots)),
        subject_is_ring=group.subject.is_ring,
        **_facts(group, assessment, now_s),
        **_texts(assessment, spot, now_s),
        outline=outline(group),
    )


def updated(before: Situation, group: Group, assessment: Assessment, now_s: float) -> Situation:
    """The next revision, but for its texts and outline: they are those of the revision before. What people are asked to
    do and its sentence are about the same."""
    facts = _facts(group, assessment, now_s)
    if assessment.keeps_sentence:
        facts |= {name: getattr(before, name) for name in ("situation_kind", "location", "culprit")}
    return before.next_revision(**facts)


def described(revision: Situation, group: Group, assessment: Assessment, spot: Spot, now_s: float) -> Situation:
    """The `revision` that `updated` made, with its own texts and outline. These take much longer than the rest."""
    texts = {} if assessment.keeps_sentence else _texts(assessment, spot, now_s)
    return revision.model_copy(update={"outline": outline(group), **texts})


def listed_robots(advisories: Iterable[AnyAdvisory]) -> tuple[str, ...]:
    """The robots that a situation with these advisories lists, in ascending order."""
    return tuple(names_of(advisories))[:MOST_ROBOTS]


def participants_of(advisories: Iterable[AnyAdvisory]) -> dict[str, ParticipantKind]:
    """By UUID, what the robots of advisories stand for. Advisories of older releases do not say it."""
    return {robot: kind for each in advisories for robot, kind in zip(each.robots, each.participants, strict=False)}


def _facts(group: Group, assessment: Assessment, now_s: float) -> dict[str, Any]:
    """All fields but texts and outline."""
    advisories, stakes, matter, listed = assessment[:4]
    names = names_of(advisories)
    vendors = {robot: vendor for each in advisories for robot, vendor in zip(each.robots, each.vendors, strict=True)}
    participants = participants_of(advisories)
    soonest = min(matter.advisories, key=lambda advisory: (advisory.time_left_s(now_s), advisory.id))
    left_s = soonest.time_left_s(now_s)
    members = sorted(group.members, key=lambda name: (group.members[name].raised_s, name))
    return {
        "situation_kind": matter.kind,
        "severity": assessment.severity,
        "robots": listed,
        "names": tuple(short_text(names[robot], MOST_NAME_BYTES) for robot in listed),
        "vendors": tuple(vendors[robot] for robot in listed),
        "participants": tuple(participants.get(robot, "robot") for robot in listed),
        "more_robots": len(names) - len(listed),
        "updated_at": moment(now_s),
        "predicted_at": soonest.predicted_at,
        "time_to_conflict_s": round(left_s, 3),
        "location": matter.principal.location,
        "culprit": matter.culprit if matter.culprit in listed else None,
        "cost_s": round(stakes.cost_s, 1),
        "preventable_s": None if stakes.preventable_s is None else round(stakes.preventable_s, 3),
        "advice": assessment.advice,
        "people_wait_for": assessment.people_wait_for,
        "advisories": tuple(members[:MOST_ADVISORIES]),
        "more_advisories": max(len(group.members) - MOST_ADVISORIES, 0),
    }


def _texts(assessment: Assessment, spot: Spot, now_s: float) -> dict[str, Any]:
    """All texts, and the places that they name."""
    matter = assessment.matter
    recurrence = assessment.stakes.recurring.get(matter.principal.id)
    is_short = recurrence is not None and recurrence.longest_s <= BY_ITSELF_S
    again = again_text(recurrence.times, WITHIN_S, recurrence.longest_s if is_short else None) if recurrence else ""
    wanted = matter.principal if isinstance(matter.principal, ContentionAdvisory) else None
    named = [NamedPlace(id=wanted.resource, name=wanted.resource_name)] if wanted and not wanted.resources else []
    names, kinds = names_of(assessment.advisories), participants_of(assessment.advisories)
    parties = [Involved(name, kinds.get(robot, "robot")) for robot, name in names.items()]
    return {
        "places": tuple(dict.fromkeys([*named, *spot.places])),
        **present_words(matter, parties, now_s, spot.text, _spots(matter), again)._asdict(),
        "ends": ending(matter, names),
    }


def _spots(matter: Matter) -> int:
    """At how many places robots get in each other's way."""
    if matter.kind != "knot":
        return 1
    locations = [advisory.location for advisory in matter.advisories if advisory.location]
    return count_spots([(location.x, location.y) for location in locations])
