"""What outcomes count for where robots leave before it is known.

Of pairs of which a robot leaves within the horizon, those that had met by then are known and those that had not are
left out. Counted alike, the known ones would show more meetings than there are. So a meeting counts for as much as the
share of the pairs still there at its moment that are there at the horizon's end: what is left out of those that had
not met is left out of those that had (inverse probability of censoring, Graf et al. 1999, scaled so that no weight is
above 1). The shares are those of Kaplan and Meier 1958. Where nobody leaves, every outcome counts 1.
"""

import numba
import numpy as np

from ingest.batch import Bools, Floats, Ints
from ingest.kernels import kernel

PARTS = 10
"""Of the horizon."""
_FLOATS, _ANY = numba.float64[::1], numba.types.Array(numba.float64, 1, "A", readonly=True)
STAYED = PARTS
"""In place of a part, for a pair of which both robots were there throughout and did not meet."""


def part_of(after_s: Floats, horizon_s: float) -> Ints:
    """The part of the horizon in which each moment lies, `STAYED` from its end on; `after_s` is since its beginning."""
    part: Ints = np.minimum(np.maximum(after_s * (PARTS / horizon_s), 0), STAYED).astype(np.int64)
    return part


def counts(part: Ints, left: Bools) -> Ints:
    """(2, PARTS + 1) how many pairs are known and were left in each part."""
    return np.bincount(part + left * (PARTS + 1), minlength=2 * (PARTS + 1)).reshape(2, -1)


@kernel(_FLOATS(*[_ANY] * 2, numba.int64))
def _weights(known: Floats, left: Floats, parts: int) -> Floats:
    stays, counted, followed = np.empty(parts), np.ones(parts + 1), known[parts] + left[parts]
    for part in range(parts - 1, -1, -1):
        followed += known[part] + left[part]
        stays[part] = 1 - left[part] / max(followed, 1e-12)
        counted[part] = counted[part + 1] * stays[part]
    return counted


def weights(known: Floats, left: Floats) -> Floats:
    """(PARTS + 1,) what an outcome in each part counts, of so many (PARTS + 1,) known and so many left in each."""
    return _weights(known, left, PARTS)
