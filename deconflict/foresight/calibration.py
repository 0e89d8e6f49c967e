"""From what a forecast looks like to the probability of what will happen, learned on the site's own history.

A logistic model with a Gaussian posterior, moved by each batch of outcomes by one Newton step (Laplace's
approximation, as in Spiegelhalter and Lauritzen 1990). What it has learned fades towards the prior, so that it follows
a site that changes; the prior is what was learned on recordings of people and of robots that avoid each other.
"""

from dataclasses import dataclass, field

import numpy as np

from deconflict.foresight.leaving import PARTS, counts, weights
from deconflict.foresight.pairs import Fates
from deconflict.learned import Part, numbers
from ingest.seam import Floats

PRIOR: Floats = np.array([0.07, 1.07, 0.2, -0.27, -0.74])
"""Weights of what is seen of a pair, see `pairs.FEATURES`."""
PRIOR_SD: Floats = np.array([0.7, 0.3, 0.3, 0.7, 0.7])
PRIOR_INFORMATION: Floats = np.diag(PRIOR_SD**-2.0)
OUTCOME_WEIGHT = 0.25
"""Outcomes of one pair in successive seconds say much the same."""
FADES_S = 900.0
CERTAIN = 0.01
"""Shares this near to 0 or 1 are not told apart from them."""


def log_odds(share: Floats) -> Floats:
    """As features of pairs have them, of shares of an error distribution."""
    odds: Floats = np.log((share + CERTAIN) / (1 + CERTAIN - share))
    return odds


@dataclass(slots=True, eq=False)
class Calibration:
    """The model, and what it has learned."""

    weights: Floats = field(default_factory=PRIOR.copy)
    information: Floats = field(default_factory=PRIOR_INFORMATION.copy)
    """(FEATURES, FEATURES) inverse of the covariance of the weights."""
    ended: Floats = field(default_factory=lambda: np.zeros((2, PARTS + 1)))
    """(2, PARTS + 1) how many pairs were known or left in each part of the horizon, faded."""
    as_of_s: float | None = None

    def probability(self, seen: Floats) -> Floats:
        """(n,) for features (n, FEATURES)."""
        with np.errstate(over="ignore"):
            probability: Floats = 1.0 / (1.0 + np.exp(-seen @ self.weights))
        return probability

    def learn(self, seen: Floats, fates: Fates, now_s: float) -> None:
        """Take in what became of n pairs, of which these were the features (n, FEATURES)."""
        if not len(seen):
            return
        kept = float(np.exp(-max(now_s - (self.as_of_s or now_s), 0.0) / FADES_S))
        self.as_of_s = now_s
        self.ended = kept * self.ended + counts(fates.part, fates.left)
        weight = OUTCOME_WEIGHT * np.where(fates.left, 0.0, weights(*self.ended)[fates.part])
        expected = self.probability(seen)
        certain = weight * expected * (1 - expected)
        self.information = kept * self.information + (1 - kept) * PRIOR_INFORMATION
        self.information += (seen * certain[:, None]).T @ seen
        self.weights = self.weights + np.linalg.solve(self.information, seen.T @ (weight * (fates.met - expected)))

    def learned(self) -> Part:
        """The weights, and the prior that they began with."""
        named = {"weights": self.weights, "information": self.information, "ended": self.ended}
        return {"prior": PRIOR, **named, "as_of_s": self.as_of_s}

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told, unless a release with another prior did. Raises `UnreadableError`."""
        if not np.array_equal(part.get("prior", ()), PRIOR):
            return
        self.weights = numbers(part, "weights", PRIOR.shape)
        self.information = numbers(part, "information", (len(PRIOR), len(PRIOR)))
        self.ended = numbers(part, "ended", self.ended.shape)
        self.as_of_s = None if part.get("as_of_s") is None else float(numbers(part, "as_of_s", ()))
