"""First contact by certified advancement: no step passes over a contact.

Along a direction n that is held, the gap closes at no more than -v.n + |wA| rA + |wB| rB, so for (gap - target) over
that there is no contact (the idea of conservative advancement, Mirtich 1996, with a directional bound). Any n may be
taken: the axes of the sides are cheap and settle most pairs at once, the direction between the closest features, in
which the gap is the distance, settles what they leave.
"""

import numpy as np

from deconflict.exact import Decider
from deconflict.rectangles import TINY_MPS
from deconflict.relative import Relative
from ingest.seam import Floats

TOLERANCE_M = 1e-3
ROUNDS = 24
"""After which few pairs are left open, and FCL decides those."""
NEAR_M = 0.02
"""So near the target, the distance itself is looked at."""


def first_contacts(motion: Relative, target_m: float, decider: Decider, rounds: int = ROUNDS) -> Floats:
    """(n,) the first time within `target_m`, to `TOLERANCE_M` and never late; inf where there is none.

    Times are seconds into the slab.
    """
    contact = np.full(len(motion), np.inf)
    live = np.flatnonzero(motion.nearest_centres() <= motion.reach + target_m + TOLERANCE_M)
    decider.asked += len(live)
    part, at = motion.take(live), motion.begin[live]
    aim_m, close_m = target_m + TOLERANCE_M / 4, target_m + TOLERANCE_M / 2
    for _ in range(rounds):
        if not len(live):
            return contact
        apart = part.apart_at(at, aim_m)
        step, met = apart.clear_s, apart.gap <= 0
        near = np.flatnonzero((apart.gap <= close_m + NEAR_M) & ~met & (at + step <= part.end))
        nearby = part.take(near)
        now = nearby.gap_at(at[near])
        closing = nearby.swing - (nearby.vx * now.nx + nearby.vy * now.ny)
        step[near] = np.maximum(step[near], (now.distance - aim_m) / np.maximum(closing, TINY_MPS))
        met[near] = now.distance <= close_m
        contact[live[met]] = at[met]
        at = at + step
        open_ = np.flatnonzero(~met & (at <= part.end))
        live, at, part = live[open_], at[open_], part.take(open_)
    for row, begin in zip(live.tolist(), at.tolist(), strict=True):
        contact[row] = decider.first_contact(motion, row, begin)
    return contact
