"""First contact by certified advancement: no step passes over a contact.

With d the exact distance and n the direction between the closest features, the gap along the fixed n is d now
and cannot close faster than -v.n + |wA| rA + |wB| rB, so for (d - target) over that there is none (the idea of
conservative advancement, Mirtich 1996, with a directional bound).
"""

import numpy as np

from deconflict.exact import Decider
from deconflict.relative import Relative
from ingest.seam import Floats

TOLERANCE_M = 1e-3
ROUNDS = 20
"""After which few pairs are left open, and FCL decides those."""
TINY_MPS = 1e-12


def first_contacts(motion: Relative, target_m: float, decider: Decider, rounds: int = ROUNDS) -> Floats:
    """(n,) the first time within `target_m`, to `TOLERANCE_M` and never late; inf where there is none.

    Times are seconds into the slab.
    """
    contact = np.full(len(motion), np.inf)
    live = np.flatnonzero(motion.nearest_centres() <= motion.reach + target_m + TOLERANCE_M)
    at = motion.begin[live]
    close = target_m + TOLERANCE_M / 2
    for _ in range(rounds):
        if not len(live):
            return contact
        part = motion.take(live)
        now = part.gap_at(at)
        met = now.distance <= close
        contact[live[met]] = at[met]
        closing = part.swing - (part.vx * now.nx + part.vy * now.ny)
        step = (now.distance - (target_m + TOLERANCE_M / 4)) / np.maximum(closing, TINY_MPS)
        at = at + step
        open_ = ~met & (at <= part.end) & (closing > TINY_MPS)
        live, at = live[open_], at[open_]
    for row, begin in zip(live.tolist(), at.tolist(), strict=True):
        contact[row] = decider.first_contact(motion, row, begin)
    return contact
