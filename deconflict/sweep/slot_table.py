"""The robots on a floor: a slot for each, and their newest forecasts in arrays."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.geometry.knots import KNOT, ROBOT, UNSOUND, Knots, Robots, replace, taken
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.shapes.shape_table import SHAPES
from deconflict.sweep.shapes.shape_table import UNSOUND as UNSOUND_SHAPE
from ingest.batch import Floats, Forecasts, Ints

FEWEST_KNOTS = 10_000
"""The array of knots has at least this size once it is packed."""


class SlotTable(RobotSlots):
    """Keys and forecasts by slot, with spare slots. A robot keeps its slot until it leaves; another may then get it.

    Robots come by `replace_forecasts` and leave by `discard`, not by `assign` and `release`. Trailers have keys, too.
    """

    def __init__(self) -> None:
        super().__init__()
        self.keys: NDArray[np.object_] = np.zeros(0, object)
        """(slots,) keys; "" for a free slot."""
        self.robots: Robots = np.zeros(0, ROBOT)
        """(slots,) of `ROBOT`; a free slot has no knots."""
        self.knots: Knots = np.zeros(0, KNOT)
        """Knots of all robots, and of forecasts that were replaced."""
        self.widened_m: Floats = np.zeros(0)
        """(slots,) how much longer and wider than reported each envelope is."""
        self._used = 0
        """Knots in use."""

    def replace_forecasts(
        self, keys: Sequence[str], forecasts: Forecasts, widened_m: Floats | float = 0.0
    ) -> Ints | None:
        """Replace the forecasts of `keys`, which are all different. The envelopes are `widened_m` longer and wider than
        reported. Returns their slots; None if any new forecast can't be swept, and then no forecast is replaced."""
        shapes = SHAPES.numbers_of_sound(forecasts)
        if np.any(shapes == UNSOUND_SHAPE):
            return None
        slots, new = self.assign(keys)
        if new:
            self._name(slots[new], [keys[row] for row in new])
        used = replace(self.robots, self.knots, slots, self._used, forecasts)
        if used > len(self.knots):
            self.robots["count"][slots] = 0
            self._pack(len(forecasts.t_s))
            used = replace(self.robots, self.knots, slots, self._used, forecasts)
        if used == UNSOUND:
            return None
        self._used, self.widened_m[slots] = used, widened_m
        self._set_shapes(slots, shapes)
        return slots

    def _set_shapes(self, slots: Ints, numbers: Ints | int) -> None:
        """Set the shapes of robots. The rectangle around a shape is that of the shape, and its top not below that of a
        part, whatever was reported."""
        if isinstance(numbers, int):
            return
        self.robots["shape"][slots] = numbers
        shaped = numbers > 0
        slots, numbers = slots[shaped], numbers[shaped]
        grown_m = self.widened_m[slots] / 2
        tops_m = self.robots["bottom"][slots] + SHAPES.top_m[numbers]
        self.robots["top"][slots] = np.maximum(self.robots["top"][slots], tops_m)
        half_m = SHAPES.half_m[numbers].T + grown_m
        self.robots["grown"][slots] = grown_m
        self.robots["half_length"][slots], self.robots["half_width"][slots] = half_m
        self.robots["radius"][slots] = np.hypot(*half_m)

    def set_trains(self, trains: Mapping[str, Sequence[str]]) -> None:
        """Set which trailers each robot pulls."""
        for key, trailers in trains.items():
            slot = self.by_uuid[key]
            self.robots["train"][[slot, *map(self.by_uuid.__getitem__, trailers)]] = slot + 1

    def discard(self, keys: Iterable[str]) -> list[int]:
        """Remove robots. Returns the slots that become free."""
        left = self.release(keys)
        self.keys[left], self.robots["count"][left], self.robots["train"][left] = "", 0, 0
        return left.tolist()

    def copied(self, keys: Sequence[str]) -> tuple[Robots, Knots]:
        """Copies of the robots of `keys`, in that order, and of their knots; an unknown robot has no knots."""
        return taken(self.robots, self.knots, self.find(keys))

    def present(self, slots: Ints) -> Ints:
        """Those of `slots` whose robot has knots."""
        return slots[self.robots["count"][slots] > 0]

    def _name(self, slots: Ints, keys: Sequence[str]) -> None:
        """Note the keys of new slots, and make room for them."""
        if len(self.robots) < len(self):
            spare = len(self) + len(self) // 8 - len(self.robots)
            columns = self.robots, self.keys, self.widened_m
            self.robots, self.keys, self.widened_m = (np.pad(column, (0, spare)) for column in columns)
        self.keys[slots] = keys

    def _pack(self, spare: int) -> None:
        """Drop the knots of forecasts that were replaced, and make room for `spare` more knots."""
        slots = np.flatnonzero(self.robots["count"])
        counts = self.robots["count"][slots]
        start = np.cumsum(counts) - counts
        self._used = int(counts.sum())
        kept = self.knots[np.repeat(self.robots["first"][slots] - start, counts) + np.arange(self._used)]
        needed = self._used + spare
        self.knots = np.zeros(max(needed + needed // 4, FEWEST_KNOTS), KNOT)
        self.knots[: self._used] = kept
        self.robots["first"][slots] = start
