"""Robots that are removed because another robot has driven through their place, until they report again."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.presence.silence_outcomes import SilenceCase
from deconflict.runtime.learned_state import Form, Part, Seconds
from ingest.batch import Batch


class RemovedRobot(NamedTuple):
    """A robot through whose place another one has driven. These are also the names in JSON."""

    vendor: str
    name: str
    heard_s: float
    """When the robot was last heard."""
    at_s: float
    """When it was removed."""
    by: str
    """The name of the robot that drove through its place."""


FORM = Form(
    "vendor, name, when heard, when removed, by which", {"robots": dict[str, tuple[str, str, Seconds, Seconds, str]]}
)


class RemovedRobots:
    """The removed robots by UUID."""

    def __init__(self) -> None:
        self.robots: dict[str, RemovedRobot] = {}
        self._cases: dict[str, SilenceCase] = {}

    def add(self, uuid: str, robot: RemovedRobot, case: SilenceCase | None) -> None:
        """Remove a robot. `case` is that of its silence, None if that was not counted."""
        self.robots[uuid] = robot
        if case:
            self._cases[uuid] = case

    def put_back(self, uuid: str) -> tuple[RemovedRobot, SilenceCase | None] | None:
        """Let a robot back in. Returns its removal and the case of its silence; None if it was not removed."""
        robot = self.robots.pop(uuid, None)
        return (robot, self._cases.pop(uuid, None)) if robot else None

    def without(self, batch: Batch) -> Batch:
        """The batch without robots that have not reported since they were removed."""
        if not self.robots or self.robots.keys().isdisjoint(batch.robots):
            return batch
        stays = np.ones(len(batch), np.bool_)
        for row, uuid in enumerate(batch.robots):
            if removed := self.robots.get(uuid):
                stays[row] = batch.arrival_s[row] > removed.heard_s
        return batch if stays.all() else batch.take(np.flatnonzero(stays), batch.gone)

    def learned(self) -> Part:
        """All removed robots: they stay removed over a restart."""
        return FORM.part({"robots": {uuid: list(robot) for uuid, robot in self.robots.items()}})

    def resume(self, part: Part) -> None:
        """Go on with what `learned` returned. Raises `UnreadableError`."""
        for uuid, robot in FORM.checked(part)["robots"].items():
            self.robots[uuid] = RemovedRobot(*robot)
