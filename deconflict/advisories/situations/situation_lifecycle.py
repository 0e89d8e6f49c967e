"""The life of a situation: when it is raised, what changes are worth a revision, and when it is cleared.

    no situation --(what is at stake is worth a person's reaction)--> raised
    raised, updated --(kind, severity, robots or advice changed)--> updated
    raised, updated --(nothing of its subject was worth a reaction for a while)--> cleared

Pure: revisions of advisories and the time in, revisions of situations out.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import hypot

from deconflict.advisories.severity import rises
from deconflict.advisories.situations import situation_fields
from deconflict.advisories.situations.advice.advised_robots import AdvisedRobots
from deconflict.advisories.situations.advice.recurrences import Recurrences
from deconflict.advisories.situations.advice.stakes import Stakes, stakes_of, urgency_of_stakes
from deconflict.advisories.situations.grouping import Box, Group, Grouping
from deconflict.advisories.situations.people_last import PeopleLast
from deconflict.advisories.situations.situation_fields import Assessment
from deconflict.advisories.situations.situation_kinds import matter_of
from deconflict.advisories.situations.subject import NOWHERE, Member, Subject
from deconflict.advisories.words.words import Spot
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ClearedCode, Location, Severity
from deconflict_client.situations import AnyRevision, Situation, SituationAdvice
from ingest.batch import FloorPoint

LINGERS_S, OVER_S = 15.0, 5.0
"""A situation is cleared once it has not been worth a reaction for so long; the second, if none of its advisories is
left. So it is open for at least as long, and a person can read it."""
UPDATE_GAP_S, JOINED_GAP_S = 4.0, 0.5
"""Shortest time between two revisions, unless severity rises or advice changes; and before one that lists another
robot or advisory."""
LOOK_S = 1.0
"""A situation without news is looked at again after this time, as less and less of it can be prevented."""
WORTH_S = 1.0
"""Less loss that can be prevented is not worth a reaction."""
FALLS_S = 3.0
"""An urgency falls once it has been too high for so long."""
MOVED_S, MOVED_M = 3.0, 5.0
"""A larger change of the time or place of the first event is news."""

Describe = Callable[[Sequence[FloorPoint]], Sequence[Spot]]
"""Where points are, for a person."""


@dataclass(slots=True, eq=False)
class _Watched:
    """A group of advisories, and its situation if that is open."""

    group: Group
    situation: Situation | None = None
    last_s: float = 0.0
    """When it was worth a reaction last."""
    urgency: Severity = Severity.CAUTION
    """How severe it is if people can do something."""
    possible: SituationAdvice | None = None
    """What there was to do at the last look, whether or not anybody was asked for it."""
    held_s: float = 0.0
    """When its urgency was not too high last."""
    look_s: float = 0.0
    """When it is looked at next, unless there is news."""
    ended: AnyAdvisory | None = None
    """The last of its advisories about its subject that has ended."""


class SituationLifecycle:
    """Every situation."""

    def __init__(self, describe: Describe, people: PeopleLast | None = None) -> None:
        """`people` has them wait for robots that were asked. None where nobody hears what is asked of robots."""
        self.describe = describe
        """Renewed when the site changes."""
        self._people = people
        self._recurrences = Recurrences()
        self._advisories: dict[str, AnyAdvisory] = {}
        """The newest revision of each open advisory, by id."""
        self._grouping, self._advised = Grouping(), AdvisedRobots()
        self._watched: dict[str, _Watched] = {}
        """By id of the group."""
        self._regrouped: dict[str, Member] = {}
        """Advisories that the next pass groups, by id: restored ones, and those of a situation that was cleared."""
        self._now_s = 0.0
        """Time of the last pass."""

    def open(self) -> list[Situation]:
        """The newest revision of every open situation."""
        return [watched.situation for watched in self._watched.values() if watched.situation]

    def advisories(self) -> list[AnyAdvisory]:
        """The newest revision of every open advisory."""
        return list(self._advisories.values())

    def situation_of(self, advisory_id: str) -> str | None:
        """The id of the open situation that an advisory is part of."""
        group = self._grouping.group_of(advisory_id)
        return group.id if group and group.is_open else None

    def restore(self, situations: Iterable[Situation], advisories: Iterable[AnyAdvisory]) -> None:
        """Continue what was open before a restart. An advisory is part of the situation that lists it."""
        self._advisories = {advisory.id: advisory for advisory in advisories}
        self._regrouped = {name: Member.of(advisory) for name, advisory in self._advisories.items()}
        situations = list(situations)
        listed = {name: situation.id for situation in situations for name in situation.advisories}
        members_of: dict[str | None, dict[str, Member]] = {}
        for name, member in self._regrouped.items():
            members_of.setdefault(listed.get(name), {})[name] = member
        for situation in situations:
            group = _restored_group(situation, members_of.get(situation.id, {}))
            self._grouping.restore(group)
            updated_s = situation.updated_at.timestamp()
            watched = _Watched(group, situation, updated_s, situation.severity, situation.advice, updated_s)
            self._watched[group.id] = watched
            self._advised.keep(situation, situation.severity)

    def published(self, now_s: float, revisions: Sequence[AnyAdvisory]) -> list[AnyRevision]:
        """The `stamped` revisions of advisories, then the revisions of situations that follow from them."""
        return [*self.stamped(revisions), *self.revise(now_s, revisions)]

    def stamped(self, revisions: Iterable[AnyAdvisory]) -> list[AnyAdvisory]:
        """The revisions of advisories with the ids of the situations that they are part of so far."""
        return [stamped(revision, self.situation_of(revision.id)) for revision in revisions]

    def revise(self, now_s: float, revisions: Sequence[AnyAdvisory]) -> list[Situation]:
        """The revisions of situations that follow from those of advisories, and from the time."""
        self._follow_clock(now_s)
        changed = self._regrouped | {revision.id: self._take(revision) for revision in revisions}
        self._regrouped = {}
        for group in self._grouping.update(now_s, changed):
            self._watched.setdefault(group.id, _Watched(group)).look_s = now_s
        made = []
        due = self._due(now_s)
        while due:
            is_any_losing = False
            for watched in due:
                watched.look_s = now_s + LOOK_S
                if revision := self._revision(watched, now_s):
                    made.append(revision)
                    is_any_losing |= self._keep(watched, revision, now_s)
            due = self._due(now_s) if is_any_losing else []
        return made

    def _due(self, now_s: float) -> list[_Watched]:
        """What is to be looked at by now. A group that became part of another one is forgotten."""
        due = [watched for watched in self._watched.values() if watched.look_s <= now_s]
        gone = [watched.group.id for watched in due if watched.group.id not in self._grouping.groups]
        for group_id in gone:
            del self._watched[group_id]
        return [watched for watched in due if watched.group.id in self._watched]

    def _follow_clock(self, now_s: float) -> None:
        """Look at everything at once if the clock has gone back."""
        if now_s < self._now_s:
            for watched in self._watched.values():
                watched.look_s = now_s
                watched.last_s, watched.held_s = min(watched.last_s, now_s), min(watched.held_s, now_s)
        self._now_s = now_s

    def _take(self, revision: AnyAdvisory) -> Member | None:
        self._recurrences.take(revision)
        if revision.state is AdvisoryState.CLEARED:
            self._advisories.pop(revision.id, None)
            group = self._grouping.group_of(revision.id)
            if group and group.id in self._watched and group.subject.has(group.members[revision.id]):
                self._watched[group.id].ended = revision
            return None
        self._advisories[revision.id] = revision
        return Member.of(revision)

    def _keep(self, watched: _Watched, revision: Situation, now_s: float) -> bool:
        """Keep a revision. Situations that lose a robot to it are looked at again; returns whether there are any."""
        is_open = revision.state is not AdvisoryState.CLEARED
        watched.situation = revision if is_open else None
        losing = self._advised.keep(revision, watched.urgency)
        for name in losing:
            self._watched[name].look_s = now_s
        return bool(losing)

    def _revision(self, watched: _Watched, now_s: float) -> Situation | None:
        group, before = watched.group, watched.situation
        advisories = [self._advisories[name] for name in group.members]
        stakes = stakes_of(advisories, now_s, self._recurrences.of(advisories, now_s))
        if before is None:
            return self._raised(watched, advisories, stakes, now_s)
        if is_worth(stakes):
            watched.last_s = now_s
        elif now_s >= (closes_s := watched.last_s + (LINGERS_S if advisories else OVER_S)):
            return self._ended(watched, before, now_s)
        else:
            watched.look_s = min(watched.look_s, closes_s)
        if not advisories:
            watched.possible = None
            return situation_fields.emptied(before, self._spot(before.location), now_s) if before.advisories else None
        assessment = self._assessed(watched, advisories, stakes, now_s)
        is_urgent = rises(assessment.severity, before.severity) or assessment.advice is not before.advice
        is_listed = set(assessment.robots).issubset(before.robots) and group.members.keys() <= set(before.advisories)
        gap_s = UPDATE_GAP_S if is_listed else JOINED_GAP_S
        if not is_urgent and 0.0 <= now_s - before.updated_at.timestamp() < gap_s:
            return None
        after = situation_fields.updated(before, group, assessment, now_s)
        if not is_news(before, after):
            return None
        spot = self._spot(assessment.matter.principal.location)
        return situation_fields.described(after, group, assessment, spot, now_s)

    def _raised(
        self, watched: _Watched, advisories: Sequence[AnyAdvisory], stakes: Stakes, now_s: float
    ) -> Situation | None:
        if not advisories:
            self._forget(watched)
        if not is_worth(stakes):
            return None
        if self._is_told_as_over(watched.group) and urgency_of_stakes(stakes, None) is Severity.CAUTION:
            return None
        watched.last_s = watched.held_s = now_s
        watched.group.open(Subject.of(matter_of(advisories)))
        assessment = self._assessed(watched, advisories, stakes, now_s)
        spot = self._spot(assessment.matter.principal.location)
        return situation_fields.raised(watched.group, assessment, spot, now_s)

    def _is_told_as_over(self, group: Group) -> bool:
        """Whether the situation that a group left has nothing more in it, and its card is still there."""
        before = self._watched.get(group.split_from or "")
        return before is not None and before.situation is not None and not before.group.members

    def _assessed(
        self, watched: _Watched, advisories: Sequence[AnyAdvisory], stakes: Stakes, now_s: float
    ) -> Assessment:
        before = watched.situation
        watched.urgency = _urgency(watched, urgency_of_stakes(stakes, watched.urgency if before else None), now_s)
        robots = situation_fields.listed_robots(advisories)
        busy = self._advised.busy(watched.group.id, watched.urgency, robots)
        concerns, members = watched.group.subject.concerns, watched.group.members
        about = {name for name in members if concerns(members[name])}
        assessment = situation_fields.assessed(
            before, watched.possible, advisories, about, robots, stakes, watched.urgency, busy, now_s
        )
        watched.possible = assessment.possible
        return self._people.given_now(watched.group.id, before, assessment, busy, now_s) if self._people else assessment

    def _spot(self, location: Location | None) -> Spot:
        """Where it is, for a person; empty without a place."""
        return self.describe([FloorPoint(location.datum, location.x, location.y)])[0] if location else Spot("")

    def _cleared(self, before: Situation, code: ClearedCode, now_s: float) -> Situation:
        return situation_fields.cleared(before, code, self._spot(before.location), now_s)

    def _ended(self, watched: _Watched, before: Situation, now_s: float) -> Situation:
        """The last revision. Advisories that are still open make another group, which may become worth a reaction."""
        members, ended = watched.group.members, watched.ended
        self._forget(watched)
        self._regrouped |= members
        cleared = self._cleared(before, ClearedCode.ENDS_BY_ITSELF if members else ClearedCode.NOTHING_LEFT, now_s)
        if members or ended is None or not ended.cleared_because:
            return cleared
        why = {"cleared_code": ended.cleared_code, "cleared_because": ended.cleared_because}
        return cleared.model_copy(update=why)

    def _forget(self, watched: _Watched) -> None:
        self._grouping.remove(watched.group)
        del self._watched[watched.group.id]


def is_worth(stakes: Stakes) -> bool:
    """Whether a reaction is worth it."""
    return stakes.service_prevents_s >= WORTH_S or stakes.claim_severity is not Severity.CAUTION


def _urgency(watched: _Watched, urgency: Severity, now_s: float) -> Severity:
    """The urgency from now on: higher at once, lower after a while."""
    before = watched.urgency if watched.situation else Severity.CAUTION
    if not rises(before, urgency):
        watched.held_s = now_s
    return before if now_s - watched.held_s < FALLS_S and rises(before, urgency) else urgency


def is_news(before: Situation, after: Situation) -> bool:
    """Whether a person would act otherwise on the new revision."""
    return (
        before.severity != after.severity
        or (before.situation_kind, before.culprit) != (after.situation_kind, after.culprit)
        or (before.robots, before.participants) != (after.robots, after.participants)
        or before.is_far != after.is_far
        or (before.advice, before.people_wait_for) != (after.advice, after.people_wait_for)
        or before.advisories != after.advisories
        or _is_elsewhere(before, after)
        or (before.time_to_conflict_s > 0) != (after.time_to_conflict_s > 0)
        or abs((after.predicted_at - before.predicted_at).total_seconds()) > MOVED_S
    )


def _is_elsewhere(before: Situation, after: Situation) -> bool:
    if before.location is None or after.location is None:
        return before.location != after.location
    moved_m = hypot(after.location.x - before.location.x, after.location.y - before.location.y)
    return before.location.datum != after.location.datum or moved_m > MOVED_M


def stamped(revision: AnyAdvisory, situation_id: str | None) -> AnyAdvisory:
    """A revision with the id of its situation."""
    if revision.situation_id == situation_id:
        return revision
    return revision.model_copy(update={"situation_id": situation_id})


def _restored_group(situation: Situation, members: dict[str, Member]) -> Group:
    place = situation.location
    datum, x_m, y_m = (place.datum, place.x, place.y) if place else ("", *NOWHERE)
    group = Group(situation.id, situation.since_at.timestamp(), datum, situation.split_from)
    group.box = Box().including(x_m, y_m)
    robots = situation.subject_robots or (() if situation.subject_place else situation.robots)
    is_place, is_ring = bool(situation.subject_place), situation.subject_is_ring
    group.open(Subject(situation.subject_place) if is_place else Subject.of_robots(robots, is_ring=is_ring))
    for advisory_id, member in members.items():
        group.add(advisory_id, member)
    return group
