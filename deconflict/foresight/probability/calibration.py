"""From what a forecast looks like to the probability of what will happen, learned on the site's own history.

A logistic model with a Gaussian posterior, moved by each batch of outcomes by one Newton step (Laplace's approximation,
as in Spiegelhalter and Lauritzen 1990). What it has learned fades towards the prior, so that it follows a site that
changes. Each pair of vendors departs from the model of all by weights of its own, drawn towards none where there is
little evidence: robots of one vendor keep an order among themselves that those of two do not.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numba
import numpy as np

from deconflict.foresight.probability.censoring import PARTS, counts, weights
from deconflict.foresight.probability.pair_table import CONTACT_FEATURES, CensoredOutcomes, slots_of
from deconflict.runtime.learned_state import Part, UnreadableError, numbers
from ingest.batch import Floats, Ints
from ingest.kernels import kernel


class Prior(NamedTuple):
    """Weights of what is seen of a pair, see `pairs.FEATURES`, before anything is learned."""

    mean: Floats
    sd: Floats
    same_vendor: float = 0.0
    """What is added to the first of them for robots of one vendor."""


CONTACT = Prior(np.array([0.07, 1.07, 0.2, -0.27, -0.74]), np.array([0.7, 0.3, 0.3, 0.7, 0.7]))
"""Of coming within the clearance: learned on recordings of people and of robots that avoid each other."""
INTERACTION = Prior(
    np.array([0.25, 0.3, 0.01, -0.6, 0.0, -0.34, -0.83, -0.81, 0.32, 0.3]),
    np.array([0.7, 0.15, 0.15, 0.7, 0.7, 0.7, 0.7, 0.7, 0.15, 0.15]),
    same_vendor=-1.5,
)
"""Of getting in each other's way: learned on simulated floors of robots with plans."""
OWN_SD = 1.0, 0.15
"""How far a pair of vendors may depart from the weights of all: the first weight, and the others."""
OUTCOME_WEIGHT = 0.1
"""OpenQuestions of one pair in successive seconds say much the same."""
FADES_S = 900.0
CERTAIN = 0.01
"""Shares this near to 0 or 1 are not told apart from them."""
CAUTION = 0.5
"""Alerts are decided by the score and so many of its standard deviations."""
NINETY = 1.645
"""A normal distribution has 90 % within so many standard deviations."""


def log_odds(share: Floats) -> Floats:
    """As features of pairs have them, of shares of an error distribution."""
    odds: Floats = np.log((share + CERTAIN) / (1 + CERTAIN - share))
    return odds


_FLOATS, _MATRIX, _CUBE = numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]


@kernel(
    numba.types.Tuple((_FLOATS, _FLOATS))(_MATRIX, numba.int64[::1], _MATRIX, _CUBE)  # type: ignore[no-untyped-call]
)
def _scored(seen: Floats, model: Ints, coefficients: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """(n,) scores of features `seen` (n, features), and their variances, each by the `model` (n,) that holds for it:
    a row of `coefficients` (models, features) and of `covariance` (models, features, features)."""
    score, variance = np.zeros(len(seen)), np.zeros(len(seen))
    for row in range(len(seen)):
        factor, spread = coefficients[model[row]], covariance[model[row]]
        for i in range(seen.shape[1]):
            score[row] += factor[i] * seen[row, i]
            along = 0.0
            for j in range(seen.shape[1]):
                along += spread[i, j] * seen[row, j]
            variance[row] += along * seen[row, i]
    return score, variance


class Estimate(NamedTuple):
    """What is thought of n pairs. Arrays are (n,)."""

    probability: Floats
    lower: Floats
    """Ends of the interval that holds it with 90 %."""
    upper: Floats
    deciding: Floats
    """What alerts are decided by: above the probability where evidence is thin, so that it errs to warning."""


@dataclass(slots=True, eq=False)
class Posterior:
    """Weights with their uncertainty."""

    prior: Prior
    weights: Floats = field(init=False)
    information: Floats = field(init=False)
    """(features, features) inverse of the covariance of the weights."""
    as_of_s: float | None = None
    _covariance: Floats | None = None

    def __post_init__(self) -> None:
        self.weights, self.information = self.prior.mean.copy(), self._prior_information()

    @property
    def covariance(self) -> Floats:
        """(features, features) of the weights."""
        if self._covariance is None:
            self._covariance = np.asarray(np.linalg.inv(self.information), np.float64)
        return self._covariance

    def learn(self, seen: Floats, expected: Floats, came: Floats, weight: Floats, now_s: float) -> None:
        """One Newton step on n outcomes of features (n, features): what was expected, what `came` (n,), and what each
        counts."""
        kept = _kept(self.as_of_s, now_s)
        self.as_of_s = now_s
        certain = weight * expected * (1 - expected)
        self.information = kept * self.information + (1 - kept) * self._prior_information()
        self.information += (seen * certain[:, None]).T @ seen
        self._covariance = None
        self.weights = self.weights + np.linalg.solve(self.information, seen.T @ (weight * (came - expected)))

    def learned(self) -> Part:
        """What is worth keeping over a restart."""
        return {"weights": self.weights, "information": self.information, "as_of_s": self.as_of_s}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` gave. Raises `UnreadableError`."""
        features = len(self.prior.mean)
        self._covariance = None
        self.weights = numbers(part, "weights", (features,))
        self.information = numbers(part, "information", (features, features))
        self.as_of_s = None if part.get("as_of_s") is None else float(numbers(part, "as_of_s", ()))

    def _prior_information(self) -> Floats:
        return np.diag(self.prior.sd**-2.0)


def _kept(as_of_s: float | None, now_s: float) -> float:
    return float(np.exp(-max(now_s - (now_s if as_of_s is None else as_of_s), 0.0) / FADES_S))


@dataclass(slots=True, eq=False)
class Calibration:
    """The model of one kind of outcome, and what it has learned."""

    prior: Prior = INTERACTION
    of_all: Posterior = field(init=False)
    by_vendors: dict[int, Posterior] = field(default_factory=dict)
    """By pair of vendors, by what its weights depart from those of all."""
    ended: Floats = field(default_factory=lambda: np.zeros((2, PARTS + 1)))
    """(2, PARTS + 1) how many pairs were known or left in each part of the horizon, faded."""
    as_of_s: float | None = None

    def __post_init__(self) -> None:
        self.of_all = Posterior(self.prior)

    def estimate(self, seen: Floats, vendors: Ints) -> Estimate:
        """For features (n, features) of pairs of those `vendors` (n,)."""
        score, variance = self._scores(seen, vendors)
        spread = np.sqrt(variance)
        ends = _share(score - NINETY * spread), _share(score + NINETY * spread)
        return Estimate(_share(score), *ends, _share(score + CAUTION * spread))

    def learn(self, seen: Floats, vendors: Ints, fates: CensoredOutcomes, now_s: float) -> None:
        """Take in what became of n pairs of those `vendors` (n,), of which these were the features (n, features)."""
        if not len(seen):
            return
        self.ended = _kept(self.as_of_s, now_s) * self.ended + counts(fates.part, fates.left)
        self.as_of_s = now_s
        weight = OUTCOME_WEIGHT * np.where(fates.left, 0.0, weights(*self.ended)[fates.part])
        expected, came = _share(self._scores(seen, vendors)[0]), fates.met.astype(np.float64)
        for code in np.unique(vendors).tolist():
            rows = vendors == code
            own = self._own(code)
            own.learn(seen[rows], expected[rows], came[rows], weight[rows], now_s)
        self.of_all.learn(seen, expected, came, weight, now_s)

    def _own(self, code: int) -> Posterior:
        if code not in self.by_vendors:
            features = len(self.prior.mean)
            mean, sd = np.zeros(features), np.full(features, OWN_SD[1])
            vendor, other_vendor = slots_of(np.array([code]))
            mean[0], sd[0] = self.prior.same_vendor if vendor == other_vendor else 0.0, OWN_SD[0]
            self.by_vendors[code] = Posterior(Prior(mean, sd))
        return self.by_vendors[code]

    def _scores(self, seen: Floats, vendors: Ints) -> tuple[Floats, Floats]:
        """(n,) scores, and their variances."""
        features = len(self.prior.mean)
        known, model = np.unique(vendors, return_inverse=True)
        own = [self._own(code) for code in known.tolist()]
        weights = np.array([self.of_all.weights + posterior.weights for posterior in own])
        covariance = np.array([self.of_all.covariance + posterior.covariance for posterior in own])
        return _scored(seen, model, weights.reshape(-1, features), covariance.reshape(-1, features, features))

    def learned(self) -> Part:
        """The weights, and the prior that they began with."""
        codes = sorted(self.by_vendors)
        own = [self.by_vendors[code] for code in codes]
        features = len(self.prior.mean)
        return {
            "prior": self.prior.mean,
            **self.of_all.learned(),
            "ended": self.ended,
            "vendors": np.array(codes, np.float64),
            "own_weights": np.array([one.weights for one in own]).reshape(-1, features),
            "own_information": np.array([one.information for one in own]).reshape(-1, features, features),
        }

    def resume(self, part: Part) -> None:
        """Go on with what `learned` gave, unless a release with another prior did. Raises `UnreadableError`."""
        if not np.array_equal(part.get("prior", ()), self.prior.mean):
            return
        features = len(self.prior.mean)
        self.of_all.resume(part)
        self.ended, self.as_of_s = numbers(part, "ended", self.ended.shape), self.of_all.as_of_s
        codes, own = numbers(part, "vendors", (None,)), numbers(part, "own_weights", (None, features))
        information = numbers(part, "own_information", (None, features, features))
        if not len(codes) == len(own) == len(information):
            raise UnreadableError("the weights of pairs of vendors are not as many as the pairs")
        for code, row, matrix in zip(codes.astype(np.int64).tolist(), own, information, strict=True):
            posterior = self._own(code)
            posterior.weights, posterior.information, posterior.as_of_s = row, matrix, self.as_of_s


def _share(score: Floats) -> Floats:
    with np.errstate(over="ignore"):
        share: Floats = 1.0 / (1.0 + np.exp(-score))
    return share


def contact_features(seen: Floats) -> Floats:
    """Of features (n, FEATURES), those that tell of coming within the clearance."""
    return np.ascontiguousarray(seen[:, :CONTACT_FEATURES])
