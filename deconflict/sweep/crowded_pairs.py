"""Pairs of one robot that is in a crowd, where too many robots report from one place, and one that is not.

The first few are kept, so that a robot is warned of a crowd ahead and not of each robot in it.
"""

from collections.abc import Mapping

import numpy as np

from ingest.batch import Floats, Ints

NO_CROWDS: Mapping[str, int] = {}
MOST = 3
"""Pairs of one robot with those of one crowd."""


class CrowdedPairs:
    """Chooses the pairs that are kept. Those of the last choice stay as long as they can, so that warnings last."""

    def __init__(self) -> None:
        self._codes: Ints = np.zeros(0, np.int64)
        """Of the pairs that were kept last."""

    def kept_rows(self, a: Ints, b: Ints, contact_s: Floats, crowds: Ints) -> Ints:
        """The rows to keep of pairs of slots `a` and `b` (p,), which come near at `contact_s` (p,): all without a robot
        in `crowds` (slots,), and of the others those of the last choice and the soonest. `crowds` is 0 for a robot in
        none."""
        of_crowd = crowds[a] + crowds[b]
        mixed = np.flatnonzero(of_crowd)
        code = a[mixed] * len(crowds) + b[mixed]
        robot = np.where(crowds[a[mixed]] > 0, b[mixed], a[mixed])
        keys = (contact_s[mixed], ~np.isin(code, self._codes), of_crowd[mixed], robot)
        order = np.lexsort(keys)
        group = np.column_stack([robot, of_crowd[mixed]])[order]
        begins = np.append(True, (group[1:] != group[:-1]).any(axis=1))
        place = np.arange(len(order)) - np.maximum.accumulate(np.where(begins[: len(order)], np.arange(len(order)), 0))
        chosen = order[place < MOST]
        self._codes = code[chosen]
        is_kept = of_crowd == 0
        is_kept[mixed[chosen]] = True
        return np.flatnonzero(is_kept)
