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

    def corners(self, rows: Ints, length_m: Floats, width_m: Floats, steps: int = STEPS + 1) -> Floats:
        """(r, steps, 4, 2) corners of the envelopes of `rows`, whose sizes are (r,), in the first steps."""
        yaw_rad = self.yaw_rad[rows, :steps]
        c, s = np.cos(yaw_rad), np.sin(yaw_rad)
        along = np.stack([c, s], axis=-1) * length_m[:, None, None] / 2
        across = np.stack([-s, c], axis=-1) * width_m[:, None, None] / 2
        centre = np.stack([self.x_m[rows, :steps], self.y_m[rows, :steps]], axis=-1)
        return np.stack(
            [centre + along + across, centre - along + across, centre - along - across, centre + along - across], axis=2
        )


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
