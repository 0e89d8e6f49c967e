"""What the estimator keeps over a restart, as two parts: errors of forecasts, and weights of probabilities.

Rows of one table that are meant by rows of another are in one part, so that they are resumed together or not at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deconflict.foresight.forecast_errors.error_ledger import COLUMNS, CONTENT, ForecastKind, Ledger
from deconflict.foresight.probability.calibration import CONTACT, INTERACTION, Calibration
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.foresight.probability.pair_table import codes, slots_of
from deconflict.foresight.rollout.start_times import COUNTS, STOOD_S, StartTimes
from deconflict.runtime.learned_state import Column, Form, Learner, Part, Seconds, UnreadableError
from ingest.batch import Basis

FOLLOWING, STARTS = "following_", "starts"
"""Names of columns: what the names of the second ledger begin with, and the counts of starts."""
ERRORS = Form(
    f"{CONTENT}, of all robots and of those on their way; starts of standing robots by free or blocked way, by time "
    f"stood from {STOOD_S.tolist()} s, and seconds of standing; bases {', '.join(Basis.__members__)}",
    {"kinds": list[tuple[str, str, Basis]], "starts_as_of_s": Seconds | None},
    COLUMNS | {FOLLOWING + name: column for name, column in COLUMNS.items()} | {STARTS: COUNTS},
)
MODELS = {"calibration": INTERACTION, "contact": CONTACT}
"""The priors of the models."""


def _probabilities() -> Form:
    values: dict[str, Any] = {"vendor_names": list[str], "clearance_m": float, "horizon_s": float}
    columns: dict[str, Column] = {}
    for name, prior in MODELS.items():
        values |= {f"{name}_pairs": list[tuple[str, str]], f"{name}_as_of_s": Seconds | None}
        columns |= {f"{name}_{column}": axes for column, axes in Calibration(prior).columns(f"{name}_pairs").items()}
    return Form("; ".join(f"{name} from {prior.mean.tolist()}" for name, prior in MODELS.items()), values, columns)


PROBABILITIES = _probabilities()


def estimator_learners(estimator: ProbabilityEstimator) -> dict[str, Learner]:
    """What an estimator keeps over a restart."""
    return {
        "ledger": LearnedErrors(estimator.ledger, estimator.following, estimator.start_times),
        "calibration": LearnedProbabilities(estimator),
        "changes": estimator.degradation,
    }


@dataclass(frozen=True, slots=True)
class LearnedErrors:
    """The two ledgers and the starts. They have the same kinds of forecasts, each in the same row."""

    ledger: Ledger
    following: Ledger
    start_times: StartTimes

    def learned(self) -> Part:
        """All kinds that have cases left at the time of the newest one."""
        rows, kinds = self.ledger.rows_with_cases(), list(self.ledger.kinds)
        return ERRORS.part(
            {
                "kinds": [list(kinds[row]) for row in rows.tolist()],
                "starts_as_of_s": self.start_times.as_of_s,
                STARTS: self.start_times.of_kinds(rows),
                **self.ledger.columns(rows),
                **{FOLLOWING + name: column for name, column in self.following.columns(rows).items()},
            }
        )

    def resume(self, part: Part) -> None:
        state = ERRORS.checked(part)
        kinds = [ForecastKind(*kind) for kind in state["kinds"]]
        rows = self.ledger.restore(kinds, {name: state[name] for name in COLUMNS})
        self.following.add_kinds(self.ledger, 0.0)
        self.following.restore(kinds, {name: state[FOLLOWING + name] for name in COLUMNS})
        self.start_times.restore(rows, state[STARTS], state["starts_as_of_s"])


class LearnedProbabilities:
    """The models of both outcomes, and the vendors for whose pairs they have weights of their own.

    The weights hold for the clearance and the horizon with which they were learned.
    """

    def __init__(self, estimator: ProbabilityEstimator) -> None:
        self._learning, self._robots, bounds = estimator.learning, estimator.robots, estimator.bounds
        self._bounds = {"clearance_m": bounds.clearance_m, "horizon_s": bounds.horizon_s}

    def learned(self) -> Part:
        """The weights, and the prior from which they were learned."""
        names = list(self._robots.vendor_numbers)
        part: Part = {"vendor_names": names, **self._bounds}
        for name in MODELS:
            model: Calibration = getattr(self._learning, name)
            pairs = [[names[a], names[b]] for a, b in np.column_stack(slots_of(model.pair_codes())).tolist()]
            part |= {f"{name}_pairs": pairs, f"{name}_as_of_s": model.as_of_s}
            part |= {f"{name}_{column}": array for column, array in model.learned().items()}
        return PROBABILITIES.part(part)

    def resume(self, part: Part) -> None:
        """Weights of another clearance or horizon are left out."""
        state = PROBABILITIES.checked(part)
        if {name: state[name] for name in self._bounds} != self._bounds:
            return
        numbers = self._robots.vendor_numbers
        for name in state["vendor_names"]:
            numbers.setdefault(name, len(numbers))
        restored = [self._restored(name, state, numbers) for name in MODELS]
        for name, model in zip(MODELS, restored, strict=True):
            setattr(self._learning, name, model)

    def _restored(self, name: str, state: Part, numbers: dict[str, int]) -> Calibration:
        """A model with the weights that were kept. Raises `UnreadableError`."""
        begin = f"{name}_"
        columns = {
            column.removeprefix(begin): state[column] for column in PROBABILITIES.columns if column.startswith(begin)
        }
        codes_of_pairs = _codes(state[f"{name}_pairs"], numbers)
        return Calibration.restored(MODELS[name], codes_of_pairs, columns, state[f"{name}_as_of_s"])


def _codes(pairs: Sequence[tuple[str, str]], numbers: dict[str, int]) -> list[int]:
    """The codes of pairs of vendors. Raises `UnreadableError` for vendors that are not listed."""
    try:
        both = np.array([sorted((numbers[a], numbers[b])) for a, b in pairs], np.int64).reshape(-1, 2)
    except KeyError as error:
        raise UnreadableError(f"it has weights of a vendor that it does not list, {error}") from error
    return [int(code) for code in codes(both[:, 0], both[:, 1])]
