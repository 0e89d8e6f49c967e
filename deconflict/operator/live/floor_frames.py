"""The floor as the page draws it: each robot as a row of JSON, written once, and what changed since a version.

Pure: batches in, frames out. A row is

    [uuid, vendor, name, state, floor, basis, event_s, arrival_s, doubt_m, length_m, width_m, knots]

where `floor` indexes the frame's `floors` (-1 is compared with nothing) and `knots` are the forecast's poses one after
the other: seconds after `event_s`, x and y in metres, yaw in radians.
"""

import json
from collections import OrderedDict
from itertools import takewhile
from typing import Any

import numpy as np

from ingest.batch import Basis, Batch

GONE_KEPT = 10_000
"""Robots that have gone and are still told of; who has not heard for longer is sent the whole floor."""
BASES = {one.value: one.name.lower() for one in Basis}


class Picture:
    """Every robot on every floor, by when it changed."""

    def __init__(self) -> None:
        self.version = 0
        self.now_s = 0.0
        """The tick that the picture is of; 0 before the first."""
        self._floors: tuple[str, ...] = ()
        self._rows: OrderedDict[str, tuple[int, str]] = OrderedDict()
        """Version and row by UUID, longest unchanged first."""
        self._gone: OrderedDict[str, int] = OrderedDict()
        self._complete_since = 0
        """Who has an older version can't be told what changed."""
        self._cut: dict[int, str] = {}
        """Frames of this version, by the version that they follow."""

    def __len__(self) -> int:
        return len(self._rows)

    def put(self, batch: Batch, *, whole: bool) -> None:
        """Take in what changed by a tick, or everything anew."""
        self.version += 1
        self.now_s, self._floors, self._cut = batch.now_s, batch.floors, {}
        if whole:
            self._rows.clear()
            self._gone.clear()
            self._complete_since = self.version
        for uuid, row in zip(batch.robots, rows(batch), strict=True):
            self._rows[uuid] = self.version, row
            self._rows.move_to_end(uuid)
            self._gone.pop(uuid, None)
        for uuid in batch.gone:
            self._rows.pop(uuid, None)
            self._gone[uuid] = self.version
        while len(self._gone) > GONE_KEPT:
            _, self._complete_since = self._gone.popitem(last=False)

    def since(self, version: int) -> str:
        """What changed after `version` as one JSON object; the whole floor for 0 and for one too old to say."""
        if version not in self._cut:
            self._cut[version] = self._frame(version)
        return self._cut[version]

    def _frame(self, version: int) -> str:
        whole = version < self._complete_since or version == 0
        changed = [row for _, row in takewhile(lambda told: whole or told[0] > version, reversed(self._rows.values()))]
        gone = [] if whole else [uuid for uuid, at in self._gone.items() if at > version]
        head = {"now_s": self.now_s, "whole": whole, "floors": self._floors, "gone": gone}
        return f'{json.dumps(head)[:-1]}, "robots": [{",".join(changed)}]}}'


def rows(batch: Batch) -> list[str]:
    """One row of JSON for each robot of a batch."""
    forecasts = batch.forecasts
    start, floor = forecasts.start.tolist(), forecasts.floor.tolist()
    counts = np.diff(forecasts.start)
    after_s = (forecasts.t_s - np.repeat(batch.event_s, counts)).round(2).tolist()
    x, y = forecasts.x_m.round(2).tolist(), forecasts.y_m.round(2).tolist()
    yaw = forecasts.yaw_rad.round(3).tolist()
    numbers = [
        column.round(3).tolist()
        for column in (batch.event_s, batch.arrival_s, batch.doubt_m, forecasts.length_m, forecasts.width_m)
    ]
    words = zip(batch.robots, batch.vendors, batch.names, batch.states, batch.basis.tolist(), strict=True)
    told = []
    for i, (uuid, vendor, name, state, basis) in enumerate(words):
        here = floor[start[i]]
        stays = next((k for k in range(start[i], start[i + 1]) if floor[k] != here), start[i + 1])
        knots = [value for k in range(start[i], stays) for value in (after_s[k], x[k], y[k], yaw[k])]
        row: list[Any] = [uuid, vendor, name, state, here, BASES[basis], *(one[i] for one in numbers), knots]
        told.append(json.dumps(row, separators=(",", ":")))
    return told
