"""What people say of robots, as the receiver takes it: whose a robot is, and whether it is off the floor."""

import asyncio
import json
import logging
from collections.abc import Callable

import msgspec

from deconflict.runtime.rpc import Handler
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners import off_floor_report
from ingest.recording.operator_events import OffFloorMark
from ingest.recording.recorder import Recorder, quantise

DISK_TIMEOUT_S = 1.0
"""An answer waits at most this long until what was said is recorded."""

log = logging.getLogger(__name__)


class RobotCalls:
    """One method for each call; `handlers` has their names."""

    def __init__(self, fleet: Fleet, recorder: Recorder, now_s: Callable[[], float]) -> None:
        self._fleet, self._recorder, self._now_s = fleet, recorder, now_s
        self._returned: list[OffFloorMark] = []
        """Robots that came back by themselves, until the other ingests of a cluster are told."""

    def handlers(self) -> dict[str, Handler]:
        return {
            "give_robot": self._give_robot,
            "mark_off_floor": self._mark,
            "off_floor": self._off_floor,
            "take_returned": self._take_returned,
        }

    def record_returned(self) -> None:
        """Record the robots that came back by themselves with the last batch."""
        for mark in self._fleet.off_floor.take_returned():
            self._recorder.off_floor(mark)
            self._returned = [*self._returned[-1000:], mark]
            log.info("robot %s is back on the floor: it was heard elsewhere", mark.uuid)

    async def _give_robot(self, payload: bytes) -> bytes:
        """Let a robot belong to a vendor. The answer is the owner before, or why it can't be given."""
        uuid, vendor = json.loads(payload)
        before = self._fleet.owners.owner(uuid)
        problem = self._fleet.owners.vendors.problem_of_giving(uuid, vendor)
        if not problem and before != vendor:
            self._fleet.give(uuid, vendor)
            self._recorder.given(uuid, vendor, self._now_s())
            log.info("robot %s was given to %s; before, it was %s", uuid, vendor, before or "nobody's")
        return json.dumps({"before": before, "problem": problem}).encode()

    async def _mark(self, payload: bytes) -> bytes:
        """Take note that a robot is off the floor, or back on it. The answer is the mark that holds now, or null."""
        mark = msgspec.json.decode(payload, type=OffFloorMark)
        mark = msgspec.structs.replace(mark, at_s=quantise(mark.at_s or self._now_s()))
        if self._fleet.off_floor.note(mark):
            self._recorder.off_floor(mark)
            self._recorder.flush()
            log.info("robot %s is %s the floor, says %s", mark.uuid, "off" if mark.is_off else "on", mark.by)
            await asyncio.to_thread(self._recorder.sync, DISK_TIMEOUT_S)
        return msgspec.json.encode(self._fleet.off_floor.marks.get(mark.uuid))

    async def _off_floor(self, _: bytes) -> bytes:
        fleet = self._fleet
        return json.dumps(off_floor_report.listed(fleet.off_floor, fleet.robots, self._now_s())).encode()

    async def _take_returned(self, _: bytes) -> bytes:
        returned, self._returned = self._returned, []
        return msgspec.json.encode(returned)
