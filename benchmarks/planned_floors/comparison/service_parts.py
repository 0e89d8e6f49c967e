"""Parts of the service that a comparison switches off one at a time: by name, the change to a new engine."""

from collections.abc import Callable, Mapping

import numpy as np

from deconflict.engine.engine import Engine
from deconflict.foresight.probability.calibration import Calibration, Estimate
from deconflict.foresight.probability.censoring import CensoredOutcomes
from deconflict.foresight.probability.pair_table import DRIVEN, PREEMPTED
from deconflict.foresight.rollout.start_times import LATE_S, StartTimes
from ingest.batch import Bools, Floats, Ints

Change = Callable[[Engine], None]


class _Unlearning(Calibration):
    """A calibration that keeps its prior."""

    def learn(self, features: Floats, vendors: Ints, outcomes: CensoredOutcomes, for_all: Bools, now_s: float) -> None:
        """Learn nothing."""


class _AllAlike(Calibration):
    """A calibration that does not distinguish pairs of vendors."""

    def estimate(self, features: Floats, vendors: Ints) -> Estimate:
        return Calibration.estimate(self, features, np.zeros_like(vendors))

    def learn(self, features: Floats, vendors: Ints, outcomes: CensoredOutcomes, for_all: Bools, now_s: float) -> None:
        Calibration.learn(self, features, np.zeros_like(vendors), outcomes, for_all, now_s)


class _Blind(Calibration):
    """A calibration without some of the features."""

    hidden: slice

    def estimate(self, features: Floats, vendors: Ints) -> Estimate:
        return Calibration.estimate(self, self._visible(features), vendors)

    def learn(self, features: Floats, vendors: Ints, outcomes: CensoredOutcomes, for_all: Bools, now_s: float) -> None:
        Calibration.learn(self, self._visible(features), vendors, outcomes, for_all, now_s)

    def _visible(self, features: Floats) -> Floats:
        features = features.copy()
        features[:, self.hidden] = 0.0
        return features


class _Alone(_Blind):
    """Knows nothing of the other conflicts of a robot."""

    hidden = PREEMPTED


class _NotDriven(_Blind):
    """Knows nothing of robots that are driven on together."""

    hidden = DRIVEN


class _AtOnce(StartTimes):
    """Takes robots that wait to start when they say."""

    def weights(self, kind: Ints, blocked: Bools, stood_s: Floats) -> Floats:  # noqa: ARG002 - keeps the form
        weights = np.zeros((len(kind), len(LATE_S)))
        weights[:, 0] = 1.0
        return weights

    def late_s(self, kind: Ints, stood_s: Floats, part: Floats) -> Floats:  # noqa: ARG002 - keeps the form
        return np.zeros_like(part)


def _with(calibration: type[Calibration]) -> Change:
    def change(engine: Engine) -> None:
        engine.foresight.learning.calibration = calibration()

    return change


def _starts_at_once(engine: Engine) -> None:
    engine.foresight.start_times = _AtOnce()


PARTS: Mapping[str, Change] = {
    "learning": _with(_Unlearning),
    "pairs of vendors": _with(_AllAlike),
    "others in the way": _with(_Alone),
    "driving on together": _with(_NotDriven),
    "late starts": _starts_at_once,
}


def unchanged(_engine: Engine) -> None:
    """The unchanged service."""
