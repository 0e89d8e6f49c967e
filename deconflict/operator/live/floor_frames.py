"""The floor for the live map: one JSON row for each robot, written once, and the changes since a version.

Pure: takes in batches, gives frames. A row is

    [uuid, vendor, name, state, floor, basis, event_s, arrival_s, doubt_m, length_m, width_m, knots,
     participant, shape, trailers]

`floor` is an index into the frame's `floors`; -1 is a robot that is compared with none. `knots` has the
forecast's poses one after the other: seconds after `event_s`, x and y in metres, yaw in radians. `shape` is left out
for a rectangle without trailers. It has a list for each part: the radius of a circle, 0 for a polygon, then x and y of
each corner or of the circle's centre. `trailers` has a list for each: its length, its width and its knots.
"""

import json
from collections import OrderedDict
from collections.abc import Sequence
from itertools import chain, takewhile
from typing import Any

import numpy as np

from ingest.batch import Basis, Batch
from ingest.frames.towing import axle_at, poses_behind, towed_along
from ingest.shapes import Shape, ShapePart

MOST_GONE = 10_000
"""Number of gone robots that are remembered. A page with an older version receives the whole floor."""
BASES = {basis.value: basis.name.lower() for basis in Basis}


class FloorFrames:
    """Every robot on every floor, ordered by when it changed."""

    def __init__(self) -> None:
        self.version = 0
        self.now_s = 0.0
        """The tick of this version; 0 before the first."""
        self._floors: tuple[str, ...] = ()
        self._rows: OrderedDict[str, tuple[int, str]] = OrderedDict()
        """Version and row by UUID, longest unchanged first."""
        self._gone: OrderedDict[str, int] = OrderedDict()
        """By UUID of each gone robot, the version in which it went."""
        self._complete_since = 0
        """For an older version than this the changes are not known."""
        self._frames: dict[int, str] = {}
        """Frames to the present version, by the version that they start from."""

    def __len__(self) -> int:
        return len(self._rows)

    def add_batch(self, batch: Batch, *, whole: bool) -> None:
        """Take in the changes of one tick, or the whole floor."""
        self.version += 1
        self.now_s, self._floors, self._frames = batch.now_s, batch.floors, {}
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
        while len(self._gone) > MOST_GONE:
            _, self._complete_since = self._gone.popitem(last=False)

    def since(self, version: int) -> str:
        """The changes after `version` as a JSON object; the whole floor for 0 and for a version that is too old."""
        if version not in self._frames:
            self._frames[version] = self._frame(version)
        return self._frames[version]

    def _frame(self, version: int) -> str:
        whole = version < self._complete_since or version == 0
        newest_first = reversed(self._rows.values())
        changed = [row for _, row in takewhile(lambda item: whole or item[0] > version, newest_first)]
        gone = [] if whole else [uuid for uuid, gone_version in self._gone.items() if gone_version > version]
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
    columns = [
        column.round(3).tolist()
        for column in (batch.event_s, batch.arrival_s, batch.doubt_m, forecasts.length_m, forecasts.width_m)
    ]
    robots = zip(batch.robots, batch.vendors, batch.names, batch.states, batch.basis.tolist(), strict=True)
    written = []
    for i, (uuid, vendor, name, state, basis) in enumerate(robots):
        here = floor[start[i]]
        end = next((k for k in range(start[i], start[i + 1]) if floor[k] != here), start[i + 1])
        knots = [value for k in range(start[i], end) for value in (after_s[k], x[k], y[k], yaw[k])]
        row: list[Any] = [uuid, vendor, name, state, here, BASES[basis], *(column[i] for column in columns), knots]
        row.append(batch.participants[i])
        if shape := forecasts.shape(i):
            row += [[outline_row(part) for part in shape.parts], trailer_rows(shape, knots)]
        written.append(json.dumps(row, separators=(",", ":")))
    return written


def outline_row(part: ShapePart) -> list[float]:
    """The outline of a part, as the page draws it."""
    return [round(value, 3) for value in (part.radius_m, *chain.from_iterable(part.outline_m))]


def trailer_rows(shape: Shape, knots: Sequence[float]) -> list[list[float]]:
    """The trailers of a robot with `knots`: length, width, and knots like those of robots."""
    rows = [[trailer.length_m, trailer.width_m] for trailer in shape.trailers]
    yaws_rad, hitches_m = [trailer.yaw_rad for trailer in shape.trailers], [each.hitch_m for each in shape.trailers]
    axle_before: tuple[float, float] | None = None
    for after_s, x_m, y_m, yaw_rad in zip(*[iter(knots)] * 4, strict=True):
        axle = axle_at(x_m, y_m, yaw_rad, shape.axle_m)
        if axle_before:
            yaws_rad = towed_along(yaws_rad, hitches_m, axle[0] - axle_before[0], axle[1] - axle_before[1])
        for row, pose in zip(rows, poses_behind(axle, yaws_rad, hitches_m), strict=True):
            row += [after_s, *(round(value, 3) for value in pose)]
        axle_before = axle
    return rows
