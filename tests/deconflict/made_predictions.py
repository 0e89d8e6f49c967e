"""Predictions in columns, as the life of advisories takes them."""

from collections.abc import Sequence

import numpy as np

from deconflict.telling import Prediction, Predictions


def in_columns(told: Sequence[Prediction]) -> Predictions:
    real = np.array([(one.contact_s, one.separation_m, one.start_separation_m, one.probability) for one in told])
    contact_s, separation_m, start_m, probability = real.reshape(-1, 4).T.copy()
    fresh = np.array([one.fresh for one in told], np.bool_)
    return Predictions([one.pair for one in told], contact_s, separation_m, start_m, fresh, probability)
