"""Predictions and how robots meet in columns, as the life of advisories takes them."""

from collections.abc import Callable, Sequence

import numpy as np

from deconflict.encounter import CLASSES, ENCOUNTER, Encounter, Encounters
from deconflict.telling import Pair, Prediction, Predictions
from ingest.seam import Floats


def in_columns(told: Sequence[Prediction]) -> Predictions:
    real = np.array([(one.contact_s, one.separation_m, one.start_separation_m, one.probability) for one in told])
    contact_s, separation_m, start_m, probability = real.reshape(-1, 4).T.copy()
    fresh = np.array([one.fresh for one in told], np.bool_)
    there = np.array([one.there for one in told])
    return Predictions([one.pair for one in told], contact_s, separation_m, start_m, fresh, probability, there)


def each(meet: Callable[[Pair, float], Encounter]) -> Callable[[Sequence[Pair], Floats], Encounters]:
    """What `Scene.encounters` tells where `meet` tells it of one pair."""

    def encounters(pairs: Sequence[Pair], at_s: Floats) -> Encounters:
        met = map(meet, pairs, at_s.tolist())
        rows = [(one.x_m, one.y_m, CLASSES.index(one.encounter_class), one.floor) for one in met]
        return np.array(rows, ENCOUNTER)

    return encounters
