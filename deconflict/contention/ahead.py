"""Where robots will be in the next ten seconds, at even steps: many forecasts looked up at once."""

from dataclasses import dataclass

import numpy as np

from ingest.seam import Floats, Forecasts, Ints

STEP_S = 0.5
STEPS = 20
SPAN_S = 1e5
"""Apart by this, the times of several robots share one sorted key."""


@dataclass(frozen=True, slots=True, eq=False)
class Ahead:
    """n robots at `STEPS + 1` times. Arrays of poses are (n, STEPS + 1)."""

    t_s: Floats
    """(STEPS + 1,) seconds since the epoch."""
    x_m: Floats
    """Envelope centre in the floor's frame."""
    y_m: Floats
    yaw_rad: Floats
    floor: Ints

    def corners(self, row: int, length_m: float, width_m: float) -> Floats:
        """(STEPS + 1, 4, 2) corners of one robot's envelope."""
        size = np.full((2, STEPS + 1), [[length_m], [width_m]])
        return _corners(self.x_m[row], self.y_m[row], self.yaw_rad[row], size)

    def outlines(self, length_m: Floats, width_m: Floats) -> Floats:
        """(n, 4, 2) corners of every robot's envelope now."""
        return _corners(self.x_m[:, 0], self.y_m[:, 0], self.yaw_rad[:, 0], np.stack([length_m, width_m]))


def _corners(x_m: Floats, y_m: Floats, yaw_rad: Floats, size_m: Floats) -> Floats:
    """(k, 4, 2); `size_m` is (2, k) lengths and widths."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    along = np.stack([c, s], axis=-1)[:, None, :] * size_m[0, :, None, None] / 2
    across = np.stack([-s, c], axis=-1)[:, None, :] * size_m[1, :, None, None] / 2
    signs = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    corners: Floats = np.stack([x_m, y_m], axis=-1)[:, None, :] + signs[:, :1] * along + signs[:, 1:] * across
    return corners


def ahead(forecasts: Forecasts, now_s: float) -> Ahead:
    """Each robot from `now_s` on, as `Forecasts` reads between knots; before its first knot, at the first.

    One whose numbers are not finite is on floor -1.
    """
    counts = np.diff(forecasts.start)
    owner = np.repeat(np.arange(len(forecasts)), counts)
    times: Floats = STEP_S * np.arange(STEPS + 1, dtype=np.float64)
    key = owner * SPAN_S + np.clip(forecasts.t_s - now_s, -SPAN_S / 3, SPAN_S / 3)
    wanted = np.arange(len(forecasts))[:, None] * SPAN_S + times
    first, last = forecasts.start[:-1, None], forecasts.start[1:, None] - 1
    before = np.clip(np.searchsorted(key, wanted, side="right") - 1, first, last)
    after = np.minimum(before + 1, last)
    span_s = np.where(after > before, forecasts.t_s[after] - forecasts.t_s[before], 1.0)
    share = np.clip((now_s + times - forecasts.t_s[before]) / span_s, 0.0, 1.0)
    share = np.where(forecasts.floor[after] == forecasts.floor[before], share, 0.0)
    turn = forecasts.yaw_rad[after] - forecasts.yaw_rad[before]
    turn = np.arctan2(np.sin(turn), np.cos(turn))
    x_m = forecasts.x_m[before] + share * (forecasts.x_m[after] - forecasts.x_m[before])
    y_m = forecasts.y_m[before] + share * (forecasts.y_m[after] - forecasts.y_m[before])
    yaw_rad = forecasts.yaw_rad[before] + share * turn
    sound = np.isfinite(x_m + y_m + yaw_rad).all(axis=1, keepdims=True)
    return Ahead(
        t_s=now_s + times,
        x_m=np.where(sound, x_m, 0.0),
        y_m=np.where(sound, y_m, 0.0),
        yaw_rad=np.where(sound, yaw_rad, 0.0),
        floor=np.where(sound, forecasts.floor[before], -1),
    )
