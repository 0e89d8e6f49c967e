"""The robots of a batch as the `Finder` takes them."""

import numpy as np

from deconflict.foresight.interactions.interaction_finder import Reports
from ingest.batch import Batch, Floats, Ints
from ingest.kernels import ready

EXPLAINS_STANDING = frozenset(("charging", "disabled", "offline", "manualOverride", "waitingHumanEvent"))
"""Operational states of robots that do not stand for another robot."""


def reports_of(batch: Batch, slots: Ints, track: Floats, usual_m: Floats) -> Reports:
    """The n robots of a batch, which have these `slots` (n,), with `track` and `usual_m` as in `Reports`."""
    explained = np.array([state in EXPLAINS_STANDING for state in batch.states], np.bool_)
    return Reports(slots, ready(batch.event_s), track, explained, usual_m)
