"""From the features of a pair of robots to a probability, learned from the outcomes on this site.

The model is logistic with a Gaussian posterior. Each batch of outcomes moves it by one Newton step (Laplace's
approximation, as in Spiegelhalter and Lauritzen 1990). What it has learned fades towards the prior, so that it follows
a site that changes. Each pair of vendors has weights of its own, which are added to those of all pairs. With little
evidence they are near 0. They are needed because robots of one vendor keep an order among themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from deconflict.foresight.probability.censoring import PARTS, CensoredOutcomes, counts, weights
from deconflict.foresight.probability.pair_table import CONTACT_FEATURES, slots_of
from deconflict.runtime.learned_state import Column, UnreadableError, count_column
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import CUBE, FLOATS, INTS, MATRIX, kernel


class Prior(NamedTuple):
    """The weights of the features of a pair, see `pair_table.FEATURES`, before anything is learned."""

    mean: Floats
    """(features,)"""
    sd: Floats
    """(features,) standard deviations."""
    same_vendor: float = 0.0
    """Added to the first weight for robots of one vendor."""


CONTACT = Prior(np.array([0.07, 1.07, 0.2, -0.27, -0.74]), np.array([0.7, 0.3, 0.3, 0.7, 0.7]))
"""For coming within the clearance. Learned on recordings of people and of robots that avoid each other."""
INTERACTION = Prior(
    np.array([0.25, 0.3, 0.01, -0.6, 0.0, -0.34, -0.83, -0.81, 0.32, 0.3]),
    np.array([0.7, 0.15, 0.15, 0.7, 0.7, 0.7, 0.7, 0.7, 0.15, 0.15]),
    same_vendor=-1.5,
)
"""For getting in each other's way. Learned on simulated floors of robots with plans."""
OWN_SD = 1.0, 0.15
"""Standard deviations of the weights of one pair of vendors: of the first weight, and of the others."""
OUTCOME_WEIGHT = 0.1
"""What one outcome counts: outcomes of one pair in successive seconds are much alike."""
FADES_S = 900.0
"""Time in which the evidence falls to a share of 1 / e."""
CERTAIN = 0.01
"""Shares nearer than about this to 0 or 1 count as much the same as 0 or 1."""
CAUTION = 0.5
"""Alerts are decided by the score plus this many of its standard deviations."""
KEEP_APART = 0.25
"""If robots of one vendor have a first weight that is less by this than at first, no caution is needed for them."""
MOST_WEIGHT, MOST_INFORMATION = 1e4, 1e12
"""Learned numbers beyond are damage."""
NINETY = 1.645
"""90 % of a normal distribution is within this many standard deviations."""


def log_odds(share: Floats) -> Floats:
    """The log odds of shares of an error distribution, as features have them."""
    return np.log((share + CERTAIN) / (1 + CERTAIN - share))


@kernel((MATRIX, INTS, FLOATS, MATRIX, MATRIX, CUBE))
def _scored(
    features: Floats, model: Ints, of_all: Floats, of_all_covariance: Floats, own: Floats, own_covariance: Floats
) -> tuple[Floats, Floats]:
    """(n,) scores of pairs with these features (n, features), and their variances.

    The weights of a pair are those `of_all` (features,) plus its own: `model` (n,) is its row in `own` (models,
    features). So are the covariances, (features, features) and (models, features, features).
    """
    score, variance = np.zeros(len(features)), np.zeros(len(features))
    for row in range(len(features)):
        factor, spread = own[model[row]], own_covariance[model[row]]
        for i in range(features.shape[1]):
            score[row] += (of_all[i] + factor[i]) * features[row, i]
            along = 0.0
            for j in range(features.shape[1]):
                along += (of_all_covariance[i, j] + spread[i, j]) * features[row, j]
            variance[row] += along * features[row, i]
    return score, variance


class VendorModels(NamedTuple):
    """Of m pairs of vendors, the weights that are added to those of all pairs."""

    vendors: Ints
    """(m,) their codes, ascending."""
    weights: Floats
    """(m, features)"""
    covariance: Floats
    """(m, features, features)"""

    def rows_of(self, vendors: Ints) -> Ints | None:
        """(n,) the rows of pairs of `vendors` (n,); None if some are not known."""
        rows = np.searchsorted(self.vendors, vendors)
        are_known = (rows < len(self.vendors)).all() and (self.vendors[rows] == vendors).all()
        return rows if are_known else None


class Estimate(NamedTuple):
    """Probabilities of n pairs. Arrays are (n,)."""

    probability: Floats
    lower: Floats
    """Lower end of the 90 % interval of the probability."""
    upper: Floats
    """Upper end of it."""
    deciding: Floats
    """Alerts are decided by this. It is above the probability if evidence is thin, so that an error is rather a
    warning too many."""


@dataclass(slots=True, eq=False)
class Posterior:
    """The weights of a model, with their uncertainty."""

    prior: Prior
    weights: Floats = field(init=False)
    """(features,)"""
    information: Floats = field(init=False)
    """(features, features) inverse of the covariance of the weights."""
    as_of_s: float | None = None
    """When the information was last faded; None before the first time."""
    _prior_information: Floats = field(init=False)
    """(features, features)"""
    _covariance: Floats | None = None
    """Computed when it is needed; None after each change of the information."""

    def __post_init__(self) -> None:
        self._prior_information = np.diag(self.prior.sd**-2.0)
        self.weights, self.information = self.prior.mean.copy(), self._prior_information

    @property
    def covariance(self) -> Floats:
        """(features, features) of the weights."""
        if self._covariance is None:
            self._covariance = np.asarray(np.linalg.inv(self.information), np.float64)
        return self._covariance

    def learn(self, features: Floats, expected: Floats, happened: Floats, weight: Floats, now_s: float) -> None:
        """One Newton step on n outcomes of pairs with these features (n, features). (n,) each are the `expected`
        probability, 1.0 if it `happened`, and the `weight` of the outcome."""
        certain = weight * expected * (1 - expected)
        self.information = self.faded(now_s) + (features * certain[:, None]).T @ features
        self.as_of_s = now_s
        self._covariance = None
        self.weights = self.weights + np.linalg.solve(self.information, features.T @ (weight * (happened - expected)))

    def faded(self, now_s: float | None) -> Floats:
        """(features, features) the information as it is at a time."""
        kept = 1.0 if now_s is None else _kept(self.as_of_s, now_s)
        return kept * self.information + (1 - kept) * self._prior_information

    def restore(self, weights: Floats, information: Floats, as_of_s: float | None) -> None:
        """Go on with what was learned before. Raises `UnreadableError` if it is not what anything can have learned."""
        try:
            np.linalg.cholesky(information)
        except np.linalg.LinAlgError as error:
            raise UnreadableError(f"the information of weights has no inverse: {error}") from error
        if not np.allclose(information, information.T):
            raise UnreadableError("the information of weights is not symmetric")
        self.weights, self.information, self.as_of_s = weights, information, as_of_s
        self._covariance = None


def _kept(as_of_s: float | None, now_s: float) -> float:
    return float(np.exp(-max(now_s - (now_s if as_of_s is None else as_of_s), 0.0) / FADES_S))


@dataclass(slots=True, eq=False)
class Calibration:
    """The model of one kind of outcome, and what it has learned."""

    prior: Prior = INTERACTION
    of_all: Posterior = field(init=False)
    by_vendors: dict[int, Posterior] = field(default_factory=dict)
    """By pair of vendors, the weights that are added to those of all pairs."""
    ended: Floats = field(default_factory=lambda: np.zeros((2, PARTS + 1)))
    """(2, PARTS + 1) how many pairs became known, and how many left, in each part of the horizon, faded."""
    as_of_s: float | None = None
    _models: VendorModels = field(init=False)
    """Of the pairs of vendors that were asked for: the weights in `by_vendors`, side by side."""

    def __post_init__(self) -> None:
        features = len(self.prior.mean)
        self.of_all = Posterior(self.prior)
        self._models = VendorModels(np.zeros(0, np.int64), np.zeros((0, features)), np.zeros((0, features, features)))

    def estimate(self, features: Floats, vendors: Ints) -> Estimate:
        """The probabilities of n pairs with these features (n, features), of these `vendors` (n,)."""
        score, variance = self._scores(features, vendors)
        spread = np.sqrt(variance)
        cautious = score + self._caution(vendors) * spread
        return Estimate(*_share(np.array([score, score - NINETY * spread, score + NINETY * spread, cautious])))

    def _caution(self, vendors: Ints) -> Floats:
        """(n,) the caution for pairs of `vendors` (n,), which have models. Robots of one vendor need less, the more
        surely they were seen to keep out of each other's way: their fleet knows of both."""
        vendor, other_vendor = slots_of(vendors)
        own = self._models.weights[np.searchsorted(self._models.vendors, vendors), 0]
        share = np.clip(1.0 + (own - self.prior.same_vendor) / KEEP_APART, 0.0, 1.0)
        return CAUTION * np.where(vendor == other_vendor, share, 1.0)

    def learn(self, features: Floats, vendors: Ints, outcomes: CensoredOutcomes, for_all: Bools, now_s: float) -> None:
        """Learn from the outcomes of n pairs of these `vendors` (n,), which had these features (n, features). Those
        that are not `for_all` (n,) hold for pairs of the same vendors alone."""
        if not len(features):
            return
        self.ended = _kept(self.as_of_s, now_s) * self.ended + counts(outcomes.part[for_all], outcomes.left[for_all])
        self.as_of_s = now_s
        weight = OUTCOME_WEIGHT * np.where(outcomes.left, 0.0, weights(*self.ended)[outcomes.part])
        expected, happened = _share(self._scores(features, vendors)[0]), outcomes.met.astype(np.float64)
        for code in np.unique(vendors).tolist():
            rows = vendors == code
            own, model = self._own(code), np.searchsorted(self._models.vendors, code)
            own.learn(features[rows], expected[rows], happened[rows], weight[rows], now_s)
            self._models.weights[model], self._models.covariance[model] = own.weights, own.covariance
        if for_all.any():
            shared = features[for_all], expected[for_all], happened[for_all], weight[for_all]
            self.of_all.learn(*shared, now_s)

    def _own(self, code: int) -> Posterior:
        if code not in self.by_vendors:
            n_features = len(self.prior.mean)
            mean, sd = np.zeros(n_features), np.full(n_features, OWN_SD[1])
            vendor, other_vendor = slots_of(np.array([code]))
            mean[0], sd[0] = self.prior.same_vendor if vendor == other_vendor else 0.0, OWN_SD[0]
            self.by_vendors[code] = Posterior(Prior(mean, sd))
        return self.by_vendors[code]

    def _scores(self, features: Floats, vendors: Ints) -> tuple[Floats, Floats]:
        """(n,) scores, and their variances."""
        rows = self._models.rows_of(vendors)
        if rows is None:
            self._add_models(np.setdiff1d(vendors, self._models.vendors))
            rows = np.searchsorted(self._models.vendors, vendors)
        of_all, models = self.of_all, self._models
        return _scored(features, rows, of_all.weights, of_all.covariance, models.weights, models.covariance)

    def _add_models(self, codes: Ints) -> None:
        own, models = [self._own(code) for code in codes.tolist()], self._models
        rows = np.searchsorted(models.vendors, codes)
        self._models = VendorModels(
            np.insert(models.vendors, rows, codes),
            np.insert(models.weights, rows, np.array([posterior.weights for posterior in own]), axis=0),
            np.insert(models.covariance, rows, np.array([posterior.covariance for posterior in own]), axis=0),
        )

    def columns(self, pairs: str) -> dict[str, Column]:
        """What `learned` gives. `pairs` is the name of the list of pairs of vendors."""
        features = len(self.prior.mean)
        return {
            "weights": Column((features,), -MOST_WEIGHT, MOST_WEIGHT),
            "information": Column((features, features), -MOST_INFORMATION, MOST_INFORMATION),
            "ended": count_column(2, PARTS + 1),
            "own_weights": Column((pairs, features), -MOST_WEIGHT, MOST_WEIGHT),
            "own_information": Column((pairs, features, features), -MOST_INFORMATION, MOST_INFORMATION),
        }

    def learned(self) -> dict[str, Floats]:
        """A copy of the weights."""
        own, features = [self.by_vendors[code] for code in self.pair_codes().tolist()], len(self.prior.mean)
        faded = [posterior.faded(posterior.as_of_s if self.as_of_s is None else self.as_of_s) for posterior in own]
        return {
            "weights": self.of_all.weights.copy(),
            "information": self.of_all.information.copy(),
            "ended": self.ended.copy(),
            "own_weights": np.array([posterior.weights for posterior in own]).reshape(-1, features),
            "own_information": np.array(faded).reshape(-1, features, features),
        }

    def pair_codes(self) -> Ints:
        """(v,) the pairs of vendors that have weights of their own, ascending."""
        return np.array(sorted(self.by_vendors), np.int64)

    @classmethod
    def restored(
        cls, prior: Prior, codes: Sequence[int], columns: Mapping[str, Floats], as_of_s: float | None
    ) -> "Calibration":
        """The model with the weights that `learned` gave, for these pairs of vendors. Raises `UnreadableError`."""
        model = cls(prior)
        model.of_all.restore(columns["weights"], columns["information"], as_of_s)
        for code, own, information in zip(codes, columns["own_weights"], columns["own_information"], strict=True):
            model._own(code).restore(own, information, as_of_s)
        model.ended, model.as_of_s = columns["ended"], as_of_s
        return model


def _share(score: Floats) -> Floats:
    with np.errstate(over="ignore"):
        share: Floats = 1.0 / (1.0 + np.exp(-score))
    return share


def contact_features(features: Floats) -> Floats:
    """Of features (n, FEATURES), those that predict whether the envelopes come within the clearance."""
    return np.ascontiguousarray(features[:, :CONTACT_FEATURES])
