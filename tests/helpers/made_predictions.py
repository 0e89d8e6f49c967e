"""Predictions and how robots meet in columns, as the life of advisories takes them."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from deconflict.advisories.conflict_wording import Prediction, Predictions
from deconflict.sweep.geometry.encounter import CLASSES, ENCOUNTER, Encounter, Encounters
from ingest.batch import Floats, Pair


def in_columns(told: Sequence[Prediction]) -> Predictions:
    columns: dict[str, Any] = {
        name: np.array(
            [getattr(one, "probability" if name == "deciding" else name) for one in told],
            np.bool_ if name in ("fresh", "still") else np.float64,
        )
        for name in Prediction._fields
        if name != "pair"
    }
    return Predictions(pairs=[one.pair for one in told], **columns)


def each(meet: Callable[[Pair, float], Encounter]) -> Callable[[Sequence[Pair], Floats], Encounters]:
    """What `Scene.encounters` tells where `meet` tells it of one pair."""

    def encounters(pairs: Sequence[Pair], at_s: Floats) -> Encounters:
        met = map(meet, pairs, at_s.tolist())
        rows = [(one.x_m, one.y_m, CLASSES.index(one.encounter_class), one.floor) for one in met]
        return np.array(rows, ENCOUNTER)

    return encounters
