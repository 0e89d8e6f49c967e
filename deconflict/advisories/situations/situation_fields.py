"""The fields of a situation's revisions. Whether a revision is due, others decide. Pure."""

from collections.abc import Iterable, Sequence
from typing import Any

import shapely

from deconflict.advice.document_limits import MOST_NAME_BYTES, MOST_ROBOTS, short_text
from deconflict.advisories.situations.action_sets import proposal_of
from deconflict.advisories.situations.grouping import Group
from deconflict.advisories.situations.situation import MOST_ADVISORIES, MOST_CORNERS, Situation
from deconflict.advisories.situations.situation_advice import revised_advice
from deconflict.advisories.situations.situation_kinds import matter_of
from deconflict.advisories.situations.situation_wording import ending, names_of, sentence
from deconflict.advisories.situations.stakes import Stakes, severity_of_stakes
from deconflict.advisory import AdvisoryState, AnyAdvisory, Severity, moment

NOTHING_LEFT: dict[str, Any] = {"advice": None, "advisories": (), "more_advisories": 0}
MARGIN_M = 1.5
"""The outline keeps this distance from the places of the advisories."""


def emptied(before: Situation, now_s: float) -> Situation:
    """The revision of a situation whose last advisory has ended, until it is cleared."""
    nothing: dict[str, Any] = {"severity": Severity.CAUTION, "preventable_s": None, "cost_s": 0.0, **NOTHING_LEFT}
    return before.next_revision(updated_at=moment(now_s), **nothing)


def raised(group: Group, advisories: Sequence[AnyAdvisory], stakes: Stakes, place: str, now_s: float) -> Situation:
    """The first revision. `place` is where it is, for a person."""
    began_s = min(advisory.raised_at for advisory in advisories)
    return Situation(
        id=group.id,
        revision=1,
        state=AdvisoryState.RAISED,
        raised_at=moment(now_s),
        since_at=began_s,
        split_from=group.split_from,
        **_fields(None, group, advisories, stakes, severity_of_stakes(stakes, None), place, now_s),
    )


def updated(
    before: Situation,
    group: Group,
    advisories: Sequence[AnyAdvisory],
    stakes: Stakes,
    severity: Severity,
    place: str,
    now_s: float,
) -> Situation:
    """The next revision."""
    return before.next_revision(**_fields(before, group, advisories, stakes, severity, place, now_s))


def has_first_advice(before: Situation, advisories: Sequence[AnyAdvisory], now_s: float) -> bool:
    """Whether there is something to do now, and there was nothing before."""
    return before.advice is None and bool(proposal_of(advisories, before.robots, now_s).actions)


def listed_robots(advisories: Iterable[AnyAdvisory]) -> list[str]:
    """The robots that a situation with these advisories lists, in ascending order."""
    return list(names_of(advisories))[:MOST_ROBOTS]


def _fields(
    before: Situation | None,
    group: Group,
    advisories: Sequence[AnyAdvisory],
    stakes: Stakes,
    severity: Severity,
    place: str,
    now_s: float,
) -> dict[str, Any]:
    matter, names = matter_of(advisories, before.situation_kind if before else None), names_of(advisories)
    vendors = {robot: vendor for each in advisories for robot, vendor in zip(each.robots, each.vendors, strict=True)}
    listed = listed_robots(advisories)
    soonest = min(advisories, key=lambda advisory: (advisory.time_left_s(now_s), advisory.id))
    left_s = soonest.time_left_s(now_s)
    members = sorted(group.members, key=lambda name: (group.members[name].raised_s, name))
    return {
        "situation_kind": matter.kind,
        "severity": severity,
        "robots": tuple(listed),
        "names": tuple(short_text(names[robot], MOST_NAME_BYTES) for robot in listed),
        "vendors": tuple(vendors[robot] for robot in listed),
        "more_robots": len(names) - len(listed),
        "updated_at": moment(now_s),
        "predicted_at": soonest.predicted_at,
        "time_to_conflict_s": round(left_s, 3),
        "location": matter.principal.location,
        "outline": outline(group),
        "summary": sentence(matter, now_s, place),
        "ends": ending(matter, names),
        "cost_s": round(stakes.cost_s, 1),
        "preventable_s": None if stakes.preventable_s is None else round(stakes.preventable_s, 3),
        "advice": revised_advice(
            before.advice if before else None, proposal_of(advisories, listed, now_s), listed, now_s
        ),
        "advisories": tuple(members[:MOST_ADVISORIES]),
        "more_advisories": max(len(group.members) - MOST_ADVISORIES, 0),
    }


def outline(group: Group) -> tuple[tuple[float, float], ...]:
    """Corners of the area around the places of its advisories, in metres; empty without a place."""
    if not group.datum:
        return ()
    places = shapely.MultiPoint([(member.x_m, member.y_m) for member in group.members.values()])
    area = places.convex_hull.buffer(MARGIN_M, quad_segs=2)
    if len(area.exterior.coords) > MOST_CORNERS + 1:
        area = places.envelope.buffer(MARGIN_M, quad_segs=2)
    return tuple((round(x, 2), round(y, 2)) for x, y in area.exterior.coords[:-1])
