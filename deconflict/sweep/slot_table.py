"""The newest forecasts of the robots on a floor, in arrays by their slots."""

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from deconflict.sweep.geometry.knots import KNOT, ROBOT, UNSOUND, Knots, Robots, replace, taken
from deconflict.sweep.robot_slots import RobotSlots, lengthen
from deconflict.sweep.shapes.shape_table import SHAPES
from deconflict.sweep.shapes.shape_table import UNSOUND as UNSOUND_SHAPE
from deconflict.sweep.shapes.trains import is_trailer
from ingest.batch import Floats, Forecasts, Ints

FEWEST_KNOTS = 10_000
"""The array of knots has at least this size once it is packed."""


class SlotTable:
    """Forecasts by slot, with spare slots. Robots and trailers come by `replace_forecasts` and leave by `discard`."""

    def __init__(self, slots: RobotSlots) -> None:
        """`slots` are those of these robots, and maybe of others; only those of trailers are freed here."""
        self.slots = slots
        self.robots: Robots = np.zeros(0, ROBOT)
        """(slots,) of `ROBOT`; without knots where no robot of this table is."""
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
        slots, _ = self.slots.assign(keys)
        self.make_room()
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
        """Set which trailers each robot pulls. Those that have no slot, as they are off any floor, are left out."""
        for key, trailers in trains.items():
            slots = self.slots.find([key, *trailers])
            if slots[0] >= 0:
                self.robots["train"][slots[slots >= 0]] = slots[0] + 1

    def discard(self, keys: Iterable[str]) -> list[int]:
        """Remove robots and trailers. Returns their slots; those of trailers are free."""
        keys = list(keys)
        left = [slot for key in keys if (slot := self.slots.by_uuid.get(key, len(self.robots))) < len(self.robots)]
        self.robots["count"][left], self.robots["train"][left] = 0, 0
        self.slots.release(filter(is_trailer, keys))
        return left

    def find(self, keys: Collection[str]) -> Ints:
        """(n,) the slot of each robot; -1 for one without knots."""
        slots = self.slots.find(keys)
        return np.where(np.isin(slots, np.flatnonzero(self.robots["count"])), slots, -1)

    def copied(self, keys: Sequence[str]) -> tuple[Robots, Knots]:
        """Copies of the robots of `keys`, in that order, and of their knots; an unknown robot has no knots."""
        return taken(self.robots, self.knots, self.find(keys))

    def present(self, slots: Ints) -> Ints:
        """Those of `slots` whose robot has knots."""
        return slots[self.robots["count"][slots] > 0]

    def make_room(self) -> None:
        """Make room for all slots."""
        if (slots := len(self.slots)) > len(self.robots):
            lengthen(self, ("robots", "widened_m"), slots + slots // 8 - len(self.robots))

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
