"""The probability that each silent robot is still present.

Batches go in; each step returns the robots of which the probability has changed. A robot is silent once its grace time
has passed since it was last heard; see `report_intervals.grace_s`. From then on it is checked each time its silence has
grown by a fifth, so that never all robots are checked at once. If another robot has driven through its place, it is not
there: it is removed until it reports again. Pure: the same calls give the same results.
"""

from dataclasses import replace
from heapq import heappop, heappush
from math import inf
from typing import Any

import numpy as np

from deconflict.foresight.motion_assumptions import RESTING_STATES
from deconflict.foresight.presence.believed_places import BelievedPlaces, place_of
from deconflict.foresight.presence.heard_ground import HeardGround
from deconflict.foresight.presence.live_robots import LiveRobot, LiveRobots
from deconflict.foresight.presence.lost_connections import VendorConnections
from deconflict.foresight.presence.probably_left import (
    PROBABLY_LEFT,
    LastingSilence,
    LastingSilences,
    PresenceChanges,
)
from deconflict.foresight.presence.removed_robots import RemovedRobot, RemovedRobots
from deconflict.foresight.presence.report_intervals import GRACE_S, Legs, ReportIntervals
from deconflict.foresight.presence.returned_robots import datum_of, was_there
from deconflict.foresight.presence.silence_outcomes import (
    ELSEWHERE,
    LEFT,
    MAYBE_LEFT,
    MAYBE_THERE,
    THERE,
    LastSeen,
    SilenceCase,
    SilenceOutcomes,
    UsualExit,
)
from deconflict.runtime.learned_state import Learner
from deconflict.settings.site import DEFAULT, Site
from deconflict.sweep.geometry.pose import pose_at
from ingest.batch import Basis, Batch, FloorPoint, Forecasts
from ingest.measures.measures import Measures

SILENCES, PROBABLY_LEFT_ROBOTS = "deconflict_silences_total", "deconflict_robots_probably_left"
"""Names of metrics."""
HEARD_GROUND = "heard_ground"
"""The part of the learned state that files of earlier releases do not have."""
LOOK_SHARE = 0.2
"""A silent robot is checked again when its silence has grown by this share."""
LOST_LOOK_S = 5.0
"""How often it is checked whether the connection of a vendor is still lost."""
LEAST_CHANGE = 0.01
"""Smaller changes of a probability are ignored."""
KNOWN_AFTER_S, KNOWN_LEFT = 600.0, 0.1
"""The outcome of a silence counts as known, also after a restart, once the silence is longer than `KNOWN_AFTER_S` or
the probability that the robot is present is below `KNOWN_LEFT`."""
STANDS_M = 0.1
"""By a forecast that leads no further, the robot stands."""
WAY_S = np.arange(0.0, GRACE_S + 0.5).tolist()
"""Times after the last report for which the way of a robot is looked at."""
EXITS_EVERY_S = 10.0
"""How often exits are computed anew."""
MOST_SHOWN = 300
"""Most robots or exits that each list shows."""


class Presence:
    """The presence of all robots. `live` belongs to the engine, which updates it with each batch after this."""

    def __init__(self, live: LiveRobots, measures: Measures, site: Site = DEFAULT) -> None:
        self._live, self._measures = live, measures
        self._ground = HeardGround([*site.zones, *site.resources])
        self._intervals, self._connections = ReportIntervals(live.slots), VendorConnections()
        self._outcomes, self._places = SilenceOutcomes(), BelievedPlaces()
        self._last_seen_at = BelievedPlaces()
        """The last reported place of each robot that is believed to have driven on from it."""
        self.passed: set[str] = set()
        """Silent robots through which another robot drove, according to the last batch: through the outline at their
        last reported place, or at their believed place."""
        self._returned: set[str] = set()
        """Robots that were new or silent before they reported, since the last `take_returned`."""
        self.off_floor: set[str] = set()
        """Robots that a person took off the floor."""
        self.moved: set[str] = set()
        """Of the last `take_returned`, those that began anew at another place."""
        self._moved: set[str] = set()
        self.silences = LastingSilences()
        """Of robots that are silent: how probably each is still there, as of the last step."""
        self.removed = RemovedRobots()
        """Robots that are off the floor because others drove through their places, until they report again."""
        self._due: list[tuple[float, str]] = []
        """A heap of when silent robots are next checked; see `_next_s`."""
        self._next_s: dict[str, float] = {}
        """The next check of each silent robot. An entry of the heap with another time is void."""
        self._exits: tuple[float, list[UsualExit]] = (-EXITS_EVERY_S, [])
        measures.call_before_reading(self._measure)

    def receive(self, batch: Batch) -> Batch:
        """Take in the reports of a batch. Returns the batch without the robots that are still removed. Robots that are
        removed because of this batch are in its `gone`."""
        batch = self.removed.without(batch)
        for uuid in batch.began_anew:
            self._intervals.forget(uuid)
        legs, new = self._intervals.add_batch(batch)
        self._ground.add(legs, batch.floors)
        self._returned.update(batch.robots[row] for row in legs.after_silence())
        self._connections.record(batch.vendors, batch.arrival_s.tolist())
        for row in [*self._back(batch, legs), *new]:
            self._connections.join(batch.robots[row], batch.vendors[row])
        for uuid in batch.gone:
            self._forget(uuid)
        self.off_floor.difference_update(batch.robots, batch.gone)
        self.off_floor.update(batch.off_floor)
        self._moved.update(batch.began_anew)
        self.passed = set(self._last_seen_at.driven_through(batch, legs))
        for uuid in self.passed:
            self._last_seen_at.discard(uuid)
        removed = self._remove_driven_through(batch, legs)
        self.passed.update(removed)
        return replace(batch, gone=(*batch.gone, *removed)) if removed else batch

    def advance(self, now_s: float) -> PresenceChanges:
        """What has changed since the last step."""
        for uuid in self._intervals.overdue(now_s):
            self._check_overdue(uuid, now_s)
        while self._due and self._due[0][0] <= now_s:
            due_s, uuid = heappop(self._due)
            if self._next_s.get(uuid) == due_s:
                self._check_silent(uuid, self.silences.silences[uuid], self._live.robots[uuid], now_s)
        return self.silences.take_changes()

    def take_returned(self) -> set[str]:
        """The robots that were new or silent before they reported, since the last call."""
        self.moved, self._moved = self._moved, set()
        returned, self._returned = self._returned, set()
        return returned

    def silent_s(self, uuid: str, now_s: float) -> float | None:
        """For how long a silent robot has said nothing; None for a robot that is heard."""
        silence = self.silences.silences.get(uuid)
        return now_s - silence.heard_s if silence else None

    def exits(self, now_s: float) -> list[UsualExit]:
        """The places where robots usually leave, as of a few seconds ago."""
        if not 0 <= now_s - self._exits[0] < EXITS_EVERY_S:
            self._exits = now_s, self._outcomes.exits()
        return self._exits[1]

    def document(self, now_s: float) -> dict[str, Any]:
        """The JSON document for people: silent robots, the least probable first; removed robots, the newest first; and
        exits. Each list is cut to `MOST_SHOWN`."""
        fading = sorted(self.silences.fading.items(), key=lambda item: item[1])[:MOST_SHOWN]
        removed = sorted(self.removed.robots.items(), key=lambda item: -item[1].at_s)[:MOST_SHOWN]
        return {
            "fading": {uuid: round(there, 2) for uuid, there in fading},
            "taken_off": {uuid: robot._asdict() for uuid, robot in removed},
            "exits": [exit_._asdict() for exit_ in self.exits(now_s)[:MOST_SHOWN]],
        }

    @property
    def learners(self) -> dict[str, Learner]:
        """What is kept over a restart: the outcomes of silences, the removed robots, and where robots were heard."""
        return {"silences": self._outcomes, "taken_off": self.removed, HEARD_GROUND: self._ground}

    def _back(self, batch: Batch, legs: Legs) -> list[int]:
        """The rows of robots that report again, whose silences end."""
        silent, removed = self.silences.silences, self.removed.robots
        if not silent and not removed:
            return []
        back = [row for row in legs.rows.tolist() if batch.robots[row] in silent or batch.robots[row] in removed]
        for row in back:
            uuid = batch.robots[row]
            if silence := self.silences.end(uuid):
                self._end_silence(uuid, silence, batch, row)
            elif removal := self.removed.put_back(uuid):
                robot, case = removal
                self._measures.count(SILENCES, robot.vendor, "elsewhere")
                if case:
                    self._outcomes.count(case, {ELSEWHERE: 1.0})
        return back

    def _end_silence(self, uuid: str, silence: LastingSilence, batch: Batch, row: int) -> None:
        """A silence has ended with the report of a row of the batch."""
        self._next_s.pop(uuid, None)
        self._forget_place(uuid)
        is_back = was_there(self._live.robots[uuid].forecast, self._live.floors, batch, row)
        self._measures.count(SILENCES, silence.vendor, "there" if is_back else "elsewhere")
        if silence.case and silence.counts:
            self._outcomes.count(silence.case, {THERE if is_back else ELSEWHERE: 1.0})
            if is_back:
                self._outcomes.count_length(silence.case, float(batch.arrival_s[row]) - silence.heard_s)

    def _forget(self, uuid: str) -> None:
        self.silences.end(uuid)
        self.removed.put_back(uuid)
        self._next_s.pop(uuid, None)
        self._forget_place(uuid)
        self._connections.leave(uuid)
        self._intervals.forget(uuid)

    def _remove_driven_through(self, batch: Batch, legs: Legs) -> list[str]:
        """Remove the robots through whose places others have driven, and return their UUIDs.

        A robot that was moving at its last report has two possible places: where its forecast ends, and where it
        reported last. If a robot drove through the first place only, it is believed to have stopped at the second.
        """
        removed = []
        for uuid, row in self._places.driven_through(batch, legs).items():
            if (place := self._last_seen_at.get(uuid)) and uuid in self.silences.silences:
                self._believe_stopped(uuid, self.silences.silences[uuid])
                self._places.set(uuid, place)
                continue
            if silence := self.silences.end(uuid):
                name = self._live.robots[uuid].name
                robot = RemovedRobot(silence.vendor, name, silence.heard_s, batch.now_s, batch.names[row])
                case = silence.case if silence.counts else None
                self.removed.add(uuid, robot, case)
                self._measures.count(SILENCES, silence.vendor, "driven_through")
                if case:
                    self._outcomes.count(case, {LEFT: 1.0})
                removed.append(uuid)
            self._places.discard(uuid)
            self._next_s.pop(uuid, None)
        return removed

    def _believe_stopped(self, uuid: str, silence: LastingSilence) -> None:
        """A robot is believed to stand where it was last heard."""
        silence.stood = True
        self._last_seen_at.discard(uuid)
        self.silences.changes.stopped.append(uuid)

    def _forget_place(self, uuid: str) -> None:
        """Forget the believed place of a robot."""
        self._places.discard(uuid)
        self._last_seen_at.discard(uuid)

    def _plan_check(self, uuid: str, at_s: float) -> None:
        """Check a silent robot at `at_s`."""
        self._next_s[uuid] = at_s
        heappush(self._due, (at_s, uuid))

    def _check_overdue(self, uuid: str, now_s: float) -> None:
        """Check whether a robot that has not been heard for a while has fallen silent."""
        robot = self._live.robots.get(uuid)
        silent_s = self._silent_at_s(uuid, robot, now_s) if robot else inf
        self._intervals.set_due(uuid, inf if silent_s <= now_s else silent_s)
        if robot and silent_s <= now_s:
            self._check_silent(uuid, self._begin_silence(uuid, robot, now_s), robot, now_s)

    def _silent_at_s(self, uuid: str, robot: LiveRobot, now_s: float) -> float:
        """When a robot will count as silent if nothing is heard of it until then. While its vendor's connection is
        lost, or it is too soon to say: when to check again."""
        heard_s, grace_s = self._intervals.heard_s(uuid), self._intervals.grace_s(uuid)
        connection = self._connections.of(robot.vendor)
        if connection.is_lost(now_s):
            return now_s + LOST_LOOK_S
        excused_s, soon_s = connection.excused_s(heard_s, grace_s), self._intervals.soon_s(uuid)
        if now_s < heard_s + soon_s + excused_s:
            return heard_s + soon_s + excused_s
        case = self._case_of(robot, self._last_seen(uuid, robot))
        has_left = case and self._outcomes.there(case, soon_s, soon_s) < PROBABLY_LEFT
        return heard_s + (soon_s if has_left else grace_s) + excused_s

    def _begin_silence(self, uuid: str, robot: LiveRobot, now_s: float) -> LastingSilence:
        """A robot falls silent. Returns its silence."""
        heard_s, grace_s = self._intervals.heard_s(uuid), self._intervals.grace_s(uuid)
        self._connections.leave(uuid)
        forecast, last_seen = robot.forecast, self._last_seen(uuid, robot)
        goes = _goes(forecast)
        if last_seen is LastSeen.STANDING and goes:
            self.silences.changes.stopped.append(uuid)
        if last_seen in (LastSeen.GOING, LastSeen.LEAVING) and goes:
            self._last_seen_at.set(uuid, place_of(forecast, pose_at(forecast, float(forecast.t_s[0])), robot.doubt_m))
        case, counts = self._case_of(robot, last_seen), now_s - heard_s < KNOWN_AFTER_S
        silence = LastingSilence(heard_s, grace_s, robot.vendor, last_seen is LastSeen.STANDING, case, counts)
        self.silences.begin(uuid, silence)
        return silence

    def _last_seen(self, uuid: str, robot: LiveRobot) -> LastSeen:
        forecast, moved = robot.forecast, self._intervals.moved(uuid)
        is_going = _goes(forecast) and moved is not False
        begin_s = float(forecast.t_s[0])
        poses = [pose_at(forecast, begin_s + after_s) for after_s in (WAY_S if is_going else WAY_S[:1])]
        way = [(pose.x_m, pose.y_m) for pose in poses if pose.floor == poses[0].floor]
        if self._ground.leads_out(datum_of(self._live.floors, poses[0].floor), way):
            return LastSeen.LEAVING
        return LastSeen.GOING if is_going else LastSeen.ARRIVED if moved else LastSeen.STANDING

    def _case_of(self, robot: LiveRobot, last_seen: LastSeen) -> SilenceCase | None:
        """The case of a robot that falls silent; None if it surely stays."""
        forecast, state = robot.forecast, robot.batch.states[robot.row]
        is_blocked = robot.basis is Basis.STATIONARY and state in ("navigating", "manualOverride")
        datum = datum_of(self._live.floors, int(forecast.floor[0]))
        if is_blocked or state in RESTING_STATES or not datum:
            return None
        point = FloorPoint(datum, float(forecast.x_m[0]), float(forecast.y_m[0]))
        return self._outcomes.case(robot.vendor, point, last_seen)

    def _check_silent(self, uuid: str, silence: LastingSilence, robot: LiveRobot, now_s: float) -> None:
        """Update the probability that a silent robot is present, its believed place, and when to check it again."""
        silent_s = now_s - silence.heard_s
        excused_s = self._connections.of(silence.vendor).excused_s(silence.heard_s, silence.grace_s)
        if silence.case:
            there = self._outcomes.there(silence.case, silent_s - excused_s, silence.grace_s)
            if silence.counts:
                known = silent_s >= KNOWN_AFTER_S or there < KNOWN_LEFT
                columns = (THERE, LEFT) if known else (MAYBE_THERE, MAYBE_LEFT)
                self._outcomes.count(silence.case, dict(zip(columns, (there, 1.0 - there), strict=True)))
            if abs(there - silence.there) >= LEAST_CHANGE:
                self.silences.set_there(uuid, there)
        self._plan_check(uuid, min(now_s + LOOK_SHARE * silent_s, self._set_place(uuid, silence, robot, now_s)))

    def _set_place(self, uuid: str, silence: LastingSilence, robot: LiveRobot, now_s: float) -> float:
        """Set the believed place of a silent robot that stands by now. Returns until when it moves by its forecast; inf
        if it stands."""
        forecast = robot.forecast
        stands_s = float(forecast.t_s[-1])
        if stands_s > now_s and not silence.stood:
            return stands_s
        pose = pose_at(forecast, float(forecast.t_s[0]) if silence.stood else now_s)
        if pose.floor >= 0:
            self._places.set(uuid, place_of(forecast, pose, robot.doubt_m))
        return inf

    def _measure(self) -> None:
        self._measures.level(PROBABLY_LEFT_ROBOTS, dict(self.silences.left))


def _goes(forecast: Forecasts) -> bool:
    return float(np.hypot(forecast.x_m - forecast.x_m[0], forecast.y_m - forecast.y_m[0]).max()) > STANDS_M
