"""Robots that are taken off, since another one has driven through their place, until they report again."""

from typing import NamedTuple

import numpy as np

from deconflict.foresight.presence.silence_outcomes import SilenceCase
from deconflict.runtime.learned_state import Part, UnreadableError
from ingest.batch import Batch


class RemovedRobot(NamedTuple):
    """A robot through whose place another one has driven."""

    vendor: str
    name: str
    heard_s: float
    """When it was last heard."""
    at_s: float
    """When it was taken off."""
    by: str
    """The name of the other one."""


class RemovedRobots:
    """By robot."""

    def __init__(self) -> None:
        self.robots: dict[str, RemovedRobot] = {}
        self._cases: dict[str, SilenceCase] = {}

    def take_off(self, uuid: str, one: RemovedRobot, case: SilenceCase | None) -> None:
        """`case` is what its silence counted as, if it did."""
        self.robots[uuid] = one
        if case:
            self._cases[uuid] = case

    def put_back(self, uuid: str) -> tuple[RemovedRobot, SilenceCase | None] | None:
        """What there was of a robot; None where it was not taken off."""
        one = self.robots.pop(uuid, None)
        return (one, self._cases.pop(uuid, None)) if one else None

    def without(self, batch: Batch) -> Batch:
        """The batch without robots that have not reported since they were taken off."""
        if not self.robots or self.robots.keys().isdisjoint(batch.robots):
            return batch
        stays = np.ones(len(batch), np.bool_)
        for row, uuid in enumerate(batch.robots):
            if off := self.robots.get(uuid):
                stays[row] = batch.arrival_s[row] > off.heard_s
        return batch if stays.all() else batch.take(np.flatnonzero(stays), batch.gone)

    def learned(self) -> Part:
        """All of them: they stay off over a restart."""
        return {"robots": {uuid: list(one) for uuid, one in self.robots.items()}}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        try:
            for uuid, (vendor, name, heard_s, at_s, by) in part.get("robots", {}).items():
                self.robots[uuid] = RemovedRobot(str(vendor), str(name), float(heard_s), float(at_s), str(by))
        except (TypeError, ValueError, AttributeError) as error:
            raise UnreadableError(f"robots that were taken off are not told: {error}") from error
