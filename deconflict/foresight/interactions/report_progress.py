"""The robots of a batch as reports for the `InteractionFinder`."""

import numpy as np

from deconflict.foresight.interactions.recent_reports import InteractionReports
from ingest.batch import Batch, Floats, Ints
from ingest.kernels import ready

EXPLAINS_STANDING = frozenset(("charging", "disabled", "offline", "waitingHumanEvent"))
"""Operational states of robots that do not stand because of another robot."""


def interaction_reports(batch: Batch, slots: Ints, track: Floats, usual_m: Floats) -> InteractionReports:
    """The n robots of a batch, which have these `slots` (n,). `track` and `usual_m` are as in `InteractionReports`."""
    explained = np.array([state in EXPLAINS_STANDING for state in batch.states], np.bool_)
    return InteractionReports(slots, ready(batch.event_s), track, explained, usual_m)
