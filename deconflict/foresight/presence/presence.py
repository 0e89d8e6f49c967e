"""How likely each silent robot is still there: batches in, and at each step the robots of which that has changed.

A robot is silent from the grace after it was last heard; see `heard`. From then on it is looked at when its silence has
grown by a fifth, never all of them at once. One whose place another robot has driven through is not there: it is taken
off, until it reports again. Pure: the same calls give the same answers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from math import inf
from typing import Any

import numpy as np

from deconflict.foresight.presence.believed_places import BelievedPlaces, place_of
from deconflict.foresight.presence.lasting_silences import LastingSilence, LastingSilences, PresenceChanges
from deconflict.foresight.presence.live_robots import LiveRobot, LiveRobots
from deconflict.foresight.presence.lost_connections import VendorConnections
from deconflict.foresight.presence.removed_robots import RemovedRobot, RemovedRobots
from deconflict.foresight.presence.report_intervals import Legs, ReportIntervals
from deconflict.foresight.presence.returned_robots import datum_of, was_there
from deconflict.foresight.presence.silence_outcomes import (
    ELSEWHERE,
    LEFT,
    MAYBE_LEFT,
    MAYBE_THERE,
    PROBABLY_LEFT,
    THERE,
    FloorPoint,
    LastSeen,
    SilenceOutcomes,
    UsualExit,
)
from deconflict.runtime.learned_state import Part
from deconflict.sweep.geometry.pose import pose_at
from ingest.batch import Basis, Batch, Floats
from ingest.measures.measures import Measures

STAYS = frozenset(("charging", "disabled", "offline"))
"""States of robots that do not leave."""
SILENCES, PROBABLY_LEFT_ROBOTS = "deconflict_silences_total", "deconflict_robots_probably_left"
"""Of the measures."""
LOOK_SHARE = 0.2
"""A silent robot is looked at when its silence has grown by this."""
LOST_LOOK_S = 5.0
"""How often it is looked whether the connection of a vendor is still lost."""
TOLD = 0.01
"""Smaller changes are not told."""
KNOWN_AFTER_S, KNOWN_LEFT = 600.0, 0.1
"""A silence that lasts longer counts as what it probably is, also for later engines; so does one after which it is less
likely that the robot is there."""
STANDS_M = 0.1
"""A robot whose forecast leads no further said that it stands."""
EXITS_EVERY_S = 10.0
MOST_SHOWN = 300


class Presence:
    """Of all robots of a floor. `live` is the engine's own, which takes in each batch after this."""

    def __init__(self, live: LiveRobots, measures: Measures) -> None:
        self._live, self._measures = live, measures
        self._hearing, self._contacts = ReportIntervals(), VendorConnections()
        self._meanings, self._places = SilenceOutcomes(), BelievedPlaces()
        self._last_seen_at = BelievedPlaces()
        """Where robots were heard last that are believed to have gone on from there."""
        self.passed: set[str] = set()
        """Silent robots through whose outline, as it was when they were heard last or as it is believed to be, another
        one drove by the last batch."""
        self._fading, self._removals = LastingSilences(), RemovedRobots()
        self._due: list[tuple[float, str]] = []
        """A heap of when silent robots are next looked at; see `_next_s`."""
        self._next_s: dict[str, float] = {}
        """By silent robot; an entry of the heap with another time is void."""
        self._exits: tuple[float, list[UsualExit]] = (-EXITS_EVERY_S, [])
        measures.ask(self._measure)

    def receive(self, batch: Batch) -> Batch:
        """Take in robots that have reported. The batch without robots that are still taken off; those that are taken
        off by it are told as gone."""
        batch = self._removals.without(batch)
        legs, new = self._hearing.add_batch(batch)
        self._contacts.record(batch.vendors, batch.arrival_s.tolist())
        for row in [*self._back(batch, legs), *new]:
            self._contacts.join(batch.robots[row], batch.vendors[row])
        for uuid in batch.gone:
            self._forget(uuid)
        self.passed = set(self._last_seen_at.driven_through(batch, legs))
        for uuid in self.passed:
            self._last_seen_at.discard(uuid)
        off = self._drive_through(batch, legs)
        self.passed.update(off)
        return replace(batch, gone=(*batch.gone, *off)) if off else batch

    def advance(self, now_s: float) -> PresenceChanges:
        """What has changed since the last step."""
        for uuid in self._hearing.overdue(now_s):
            self._listen(uuid, now_s)
        while self._due and self._due[0][0] <= now_s:
            due_s, uuid = heappop(self._due)
            if self._next_s.get(uuid) == due_s:
                self._look(uuid, now_s)
        return self._fading.take_changes()

    def there(self, uuid: str) -> float:
        """How likely a robot is still there, as of the last step; 1 for one that is heard."""
        return self._fading.fading.get(uuid, 1.0)

    def both_there(self, pairs: Sequence[tuple[str, str]]) -> Floats:
        """(n,) how likely both robots of each pair are there."""
        return self._fading.both_there(pairs)

    def has_probably_left(self, uuid: str) -> bool:
        return self.there(uuid) < PROBABLY_LEFT

    def silent_s(self, uuid: str, now_s: float) -> float | None:
        """For how long a silent robot has said nothing; None for one that is heard."""
        one = self._fading.silences.get(uuid)
        return now_s - one.heard_s if one else None

    def removal_of(self, uuid: str) -> RemovedRobot | None:
        return self._removals.robots.get(uuid)

    def exits(self, now_s: float) -> list[UsualExit]:
        """Where robots usually leave, as of a few seconds ago."""
        if not 0 <= now_s - self._exits[0] < EXITS_EVERY_S:
            self._exits = now_s, self._meanings.exits()
        return self._exits[1]

    def document(self, now_s: float) -> dict[str, Any]:
        """What people are shown, JSON-ready: those that fade, the least likely first, the newest that are taken off,
        and exits; of each the first few."""
        fading = sorted(self._fading.fading.items(), key=lambda one: one[1])[:MOST_SHOWN]
        off = sorted(self._removals.robots.items(), key=lambda one: -one[1].at_s)[:MOST_SHOWN]
        return {
            "fading": {uuid: round(there, 2) for uuid, there in fading},
            "taken_off": {uuid: one._asdict() for uuid, one in off},
            "exits": [one._asdict() for one in self.exits(now_s)[:MOST_SHOWN]],
        }

    def learned(self) -> dict[str, Part]:
        """What silences meant, and who is taken off."""
        return {"silences": self._meanings.learned(), "taken_off": self._removals.learned()}

    def resume(self, parts: Mapping[str, Part]) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        self._meanings.resume(parts.get("silences", {}))
        self._removals.resume(parts.get("taken_off", {}))

    def _back(self, batch: Batch, legs: Legs) -> list[int]:
        """The rows of robots that report again, whose silences end."""
        silences, off = self._fading.silences, self._removals.robots
        if not silences and not off:
            return []
        back = [row for row in legs.rows.tolist() if batch.robots[row] in silences or batch.robots[row] in off]
        for row in back:
            uuid = batch.robots[row]
            if silence := self._fading.end(uuid):
                self._end(uuid, silence, batch, row)
            elif removal := self._removals.put_back(uuid):
                one, case = removal
                self._measures.count(SILENCES, one.vendor, "elsewhere")
                if case:
                    self._meanings.count(case, {ELSEWHERE: 1.0})
        return back

    def _end(self, uuid: str, silence: LastingSilence, batch: Batch, row: int) -> None:
        """A silence has ended with the report of a row."""
        self._next_s.pop(uuid, None)
        self._discard(uuid)
        is_back = was_there(self._live.robots[uuid].forecast, self._live.floors, batch, row)
        self._measures.count(SILENCES, silence.vendor, "there" if is_back else "elsewhere")
        if silence.case and silence.counts:
            self._meanings.count(silence.case, {THERE if is_back else ELSEWHERE: 1.0})
            if is_back:
                self._meanings.lasted(silence.case, float(batch.arrival_s[row]) - silence.heard_s)

    def _forget(self, uuid: str) -> None:
        self._fading.end(uuid)
        self._removals.put_back(uuid)
        self._next_s.pop(uuid, None)
        self._discard(uuid)
        self._contacts.leave(uuid)
        self._hearing.forget(uuid)

    def _drive_through(self, batch: Batch, legs: Legs) -> list[str]:
        """Take off the robots through whose places others have driven.

        One that was on its way when it was heard last has stopped there, if that is not driven through too.
        """
        off = []
        for uuid, row in self._places.driven_through(batch, legs).items():
            if (place := self._last_seen_at.get(uuid)) and uuid in self._fading.silences:
                self._hold(uuid, self._fading.silences[uuid])
                self._places.set(uuid, place)
                continue
            if silence := self._fading.end(uuid):
                name = self._live.robots[uuid].name
                one = RemovedRobot(silence.vendor, name, silence.heard_s, batch.now_s, batch.names[row])
                case = silence.case if silence.counts else None
                self._removals.take_off(uuid, one, case)
                self._measures.count(SILENCES, silence.vendor, "driven_through")
                if case:
                    self._meanings.count(case, {LEFT: 1.0})
                off.append(uuid)
            self._places.discard(uuid)
            self._next_s.pop(uuid, None)
        return off

    def _hold(self, uuid: str, silence: LastingSilence) -> None:
        """A robot is believed to stand where it was heard last."""
        silence.stood = True
        self._last_seen_at.discard(uuid)
        self._fading.changes.stopped.append(uuid)

    def _discard(self, uuid: str) -> None:
        """A robot has no place any more."""
        self._places.discard(uuid)
        self._last_seen_at.discard(uuid)

    def _look_at(self, uuid: str, at_s: float) -> None:
        self._next_s[uuid] = at_s
        heappush(self._due, (at_s, uuid))

    def _look(self, uuid: str, now_s: float) -> None:
        """How likely a silent robot is still there."""
        self._follow(uuid, self._fading.silences[uuid], self._live.robots[uuid], now_s)

    def _listen(self, uuid: str, now_s: float) -> None:
        """Whether a robot has fallen silent that has not been heard for a while."""
        robot = self._live.robots.get(uuid)
        silent_s = self._silent_at_s(uuid, robot, now_s) if robot else inf
        self._hearing.set_due(uuid, inf if silent_s <= now_s else silent_s)
        if robot and silent_s <= now_s:
            self._follow(uuid, self._begun(uuid, robot, now_s), robot, now_s)

    def _silent_at_s(self, uuid: str, robot: LiveRobot, now_s: float) -> float:
        """When a robot that is not known to be silent is, if nothing is heard of it; or when to look again, while its
        vendor's connection is lost."""
        heard_s, grace_s = self._hearing.heard_s(uuid), self._hearing.grace_s(uuid)
        contact = self._contacts.of(robot.vendor)
        if contact.is_lost(now_s):
            return now_s + LOST_LOOK_S
        return heard_s + grace_s + contact.excused_s(heard_s, grace_s)

    def _begun(self, uuid: str, robot: LiveRobot, now_s: float) -> LastingSilence:
        """A silence that begins."""
        heard_s, grace_s = self._hearing.heard_s(uuid), self._hearing.grace_s(uuid)
        self._contacts.leave(uuid)
        is_standing, forecast = robot.basis is Basis.STATIONARY, robot.forecast
        goes = float(np.hypot(forecast.x_m - forecast.x_m[0], forecast.y_m - forecast.y_m[0]).max()) > STANDS_M
        moved = self._hearing.moved(uuid)
        last = LastSeen.GOING if goes and moved is not False else LastSeen.ARRIVED if moved else LastSeen.STANDING
        if last is LastSeen.STANDING and goes:
            self._fading.changes.stopped.append(uuid)
        if last is LastSeen.GOING:
            self._last_seen_at.set(uuid, place_of(forecast, pose_at(forecast, float(forecast.t_s[0])), robot.doubt_m))
        state = robot.batch.states[robot.row]
        is_blocked = is_standing and state in ("navigating", "manualOverride")
        datum = datum_of(self._live.floors, int(forecast.floor[0]))
        case = None
        if not is_blocked and state not in STAYS and datum:
            spot = FloorPoint(datum, float(forecast.x_m[0]), float(forecast.y_m[0]))
            case = self._meanings.case(robot.vendor, spot, last)
        counts = now_s - heard_s < KNOWN_AFTER_S
        silence = LastingSilence(heard_s, grace_s, robot.vendor, last is LastSeen.STANDING, case, counts)
        self._fading.begin(uuid, silence)
        return silence

    def _follow(self, uuid: str, silence: LastingSilence, robot: LiveRobot, now_s: float) -> None:
        """How likely a silent robot is there now, and when to look again."""
        silent_s = now_s - silence.heard_s
        excused_s = self._contacts.of(silence.vendor).excused_s(silence.heard_s, silence.grace_s)
        if silence.case:
            there = self._meanings.there(silence.case, silent_s - excused_s, silence.grace_s)
            if silence.counts:
                known = silent_s >= KNOWN_AFTER_S or there < KNOWN_LEFT
                columns = (THERE, LEFT) if known else (MAYBE_THERE, MAYBE_LEFT)
                self._meanings.count(silence.case, dict(zip(columns, (there, 1.0 - there), strict=True)))
            if abs(there - silence.there) >= TOLD:
                self._fading.set_there(uuid, there)
        self._look_at(uuid, min(now_s + LOOK_SHARE * silent_s, self._placed(uuid, silence, robot, now_s)))

    def _placed(self, uuid: str, silence: LastingSilence, robot: LiveRobot, now_s: float) -> float:
        """Have a place for a silent robot that stands by now; inf, or until when it moves by its forecast."""
        forecast = robot.forecast
        stands_s = float(forecast.t_s[-1])
        if stands_s > now_s and not silence.stood:
            return stands_s
        pose = pose_at(forecast, float(forecast.t_s[0]) if silence.stood else now_s)
        if pose.floor >= 0:
            self._places.set(uuid, place_of(forecast, pose, robot.doubt_m))
        return inf

    def _measure(self) -> None:
        self._measures.level(PROBABLY_LEFT_ROBOTS, dict(self._fading.left))
