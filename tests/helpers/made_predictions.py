"""Predictions in columns, as the lifecycle of conflict advisories reads them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from deconflict.foresight.conflict_predictions import Prediction, Predictions


def in_columns(predictions: Sequence[Prediction]) -> Predictions:
    """`deciding` is the probability here."""
    columns: dict[str, Any] = {
        name: np.array(
            [getattr(prediction, "probability" if name == "deciding" else name) for prediction in predictions],
            np.bool_ if name in ("fresh", "still") else np.float64,
        )
        for name in Prediction._fields
        if name != "pair"
    }
    return Predictions(pairs=[prediction.pair for prediction in predictions], **columns)
