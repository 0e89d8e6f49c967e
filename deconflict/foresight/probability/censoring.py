"""Outcomes of pairs of which a robot leaves before the outcome is known, and what each outcome counts.

Some robots leave within the horizon. Of their pairs, those that met before are known, and those that did not are
left out. If all known outcomes counted alike, they would show more meetings than there are. So a meeting counts as
much as the share of the pairs present at that moment that are still present at the end of the horizon. The share that
is left out of the pairs that did not meet is then also left out of those that met (inverse probability of censoring,
Graf et al. 1999, scaled so that no weight is above 1). The shares are Kaplan and Meier's (1958). If no robot leaves,
every outcome counts 1.
"""

from dataclasses import dataclass

import numpy as np

from ingest.batch import Bools, Floats, Ints
from ingest.kernels import ANY_FLOATS, FLOATS, INT, kernel

PARTS = 10
"""Equal parts of the horizon."""
STAYED = PARTS
"""Stands for the part if both robots were present to the end of the horizon and did not meet."""


@dataclass(frozen=True, slots=True, eq=False)
class CensoredOutcomes:
    """What happened to pairs within the horizon. Arrays are (p,)."""

    part: Ints
    """The part of the horizon in which the pair met, or in which a robot of it was last heard or began to wait as
    advised; `STAYED` if none of these happened."""
    met: Bools
    left: Bools
    """A robot of the pair was last heard, or began to wait as advised, before the pair met."""


def part_of(after_s: Floats, horizon_s: float) -> Ints:
    """The part of the horizon of each moment, `STAYED` from its end on. `after_s` counts from the horizon's start."""
    return np.minimum(np.maximum(after_s * (PARTS / horizon_s), 0), STAYED).astype(np.int64)


def outcomes_of(after_s: Floats, met: Bools, horizon_s: float) -> CensoredOutcomes:
    """The outcomes of pairs that met, or ended otherwise, `after_s` (p,) seconds into the horizon."""
    ended = part_of(after_s, horizon_s)
    part = np.where(met, np.minimum(ended, STAYED - 1), ended)
    return CensoredOutcomes(part, met, ~met & (part < STAYED))


def counts(part: Ints, left: Bools) -> Ints:
    """(2, PARTS + 1) how many pairs became known, and how many left, in each part."""
    return np.bincount(part + left * (PARTS + 1), minlength=2 * (PARTS + 1)).reshape(2, -1)


@kernel(FLOATS(*[ANY_FLOATS] * 2, INT))
def _weights(known: Floats, left: Floats, parts: int) -> Floats:
    stays, weight, at_risk = np.empty(parts), np.ones(parts + 1), known[parts] + left[parts]
    for part in range(parts - 1, -1, -1):
        at_risk += known[part] + left[part]
        stays[part] = 1 - left[part] / max(at_risk, 1e-12)
        weight[part] = weight[part + 1] * stays[part]
    return weight


def weights(known: Floats, left: Floats) -> Floats:
    """(PARTS + 1,) the weight of an outcome of each part. `known` and `left` (PARTS + 1,) are how many pairs became
    known and how many left in each part."""
    return _weights(known, left, PARTS)
