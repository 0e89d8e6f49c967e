"""Where robots will be at given times: many forecasts and many times at once."""

from dataclasses import dataclass

import numpy as np

from ingest.seam import Floats, Forecasts, Ints

SPAN_S = 1 << 20
"""Separates one robot's times from the next one's in a sort key; knots further from the epoch are drawn in."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """n robots at m times. Arrays are (n, m)."""

    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    floor: Ints

    def columns(self) -> Floats:
        """(n, m, 4) x_m, y_m, yaw_rad and floor."""
        return np.stack([self.x_m, self.y_m, self.yaw_rad, self.floor.astype(np.float64)], axis=-1)

    def take(self, rows: Ints) -> "Poses":
        return Poses(*(getattr(self, name)[rows] for name in self.__slots__))


def poses_at(forecasts: Forecasts, t_s: Floats) -> Poses:
    """Robot i at the times `t_s[i]`, (n, m), as `Forecasts` reads between knots; before the first, at the first."""
    n = len(forecasts)
    if not t_s.size:
        none = np.empty(t_s.shape)
        return Poses(none, none, none, none.astype(np.int64))
    epoch_s, first, last = float(t_s.flat[0]), forecasts.start[:-1, None], forecasts.start[1:, None] - 1
    lanes = np.arange(n) * float(SPAN_S)
    since = np.clip(forecasts.t_s - epoch_s, -SPAN_S / 4, SPAN_S / 4)
    keys = since + np.repeat(lanes, np.diff(forecasts.start))
    asked = np.clip(t_s - epoch_s, -SPAN_S / 4, SPAN_S / 4) + lanes[:, None]
    knot = np.clip(np.searchsorted(keys, asked.ravel(), "right").reshape(t_s.shape) - 1, first, last)
    after = np.minimum(knot + 1, last)
    after = np.where(forecasts.floor[after] == forecasts.floor[knot], after, knot)
    span_s = forecasts.t_s[after] - forecasts.t_s[knot]
    share = np.clip((t_s - forecasts.t_s[knot]) / np.where(span_s > 0, span_s, 1.0), 0.0, 1.0)
    turn = (forecasts.yaw_rad[after] - forecasts.yaw_rad[knot] + np.pi) % (2 * np.pi) - np.pi
    return Poses(
        _between(forecasts.x_m, knot, after, share),
        _between(forecasts.y_m, knot, after, share),
        forecasts.yaw_rad[knot] + share * turn,
        forecasts.floor[knot],
    )


def _between(column: Floats, knot: Ints, after: Ints, share: Floats) -> Floats:
    between: Floats = column[knot] + share * (column[after] - column[knot])
    return between
