"""Robots on straight ways, and the estimator that looks at their pairs."""

from dataclasses import dataclass, field, replace

import numpy as np

from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.foresight.probability.pair_candidates import SweptConflicts
from ingest.batch import AMOUNTS, Basis, Batch, Destinations, Forecasts, Pair
from ingest.measures.measures import Measures
from ingest.shapes import Shape, Trailer, shapes_of
from tests.helpers.made_encounters import NOW_S, robot

CLEARANCE_M = 0.3


NONE_SWEPT = SweptConflicts((), np.empty(0), np.empty(0), np.empty(0))


def no_stops(robots: int) -> Destinations:
    none = np.empty(0)
    return Destinations(np.zeros(robots + 1, np.int64), none, none, none, np.empty(0, np.int64))


Velocity = tuple[float, float]


@dataclass
class Walk:
    """The start of a robot, its velocity, and the velocity of its forecasts if that is another one."""

    at: tuple[float, float]
    does: Velocity
    says: Velocity | None = None
    trailers: tuple[Trailer, ...] = ()
    """With their headings at every moment."""

    def forecast(self, t_s: float) -> Forecasts:
        (x, y), (vx, vy) = self.at, self.says or self.does
        x, y = x + self.does[0] * t_s, y + self.does[1] * t_s
        made = robot([t_s, t_s + 20], [x, x + 20 * vx], [y, y + 20 * vy], float(np.arctan2(vy, vx)), (1.0, 0.5))
        return replace(made, shapes=shapes_of([Shape((), (0.0, 0.0), self.trailers) if self.trailers else None]))


@dataclass
class Stage:
    walks: dict[str, Walk]
    foresight: ProbabilityEstimator = field(
        default_factory=lambda: ProbabilityEstimator(CLEARANCE_M, CLEARANCE_M + 0.1, 10.0, Measures())
    )

    def run(self, until_s: int) -> list[dict[Pair, float]]:
        return [self.second(t_s) for t_s in range(until_s)]

    def second(self, t_s: int) -> dict[Pair, float]:
        self.foresight.receive(self.batch(float(t_s)))
        self.foresight.estimate(NOW_S + t_s, NONE_SWEPT, 0.5)
        return dict(self.foresight.probabilities())

    def batch(self, t_s: float) -> Batch:
        n, now_s = len(self.walks), NOW_S + t_s
        return Batch(
            now_s=now_s,
            floors=("hall",),
            robots=tuple(self.walks),
            vendors=("Alder",) * n,
            models=tuple(self.walks),
            names=tuple(self.walks),
            states=("navigating",) * n,
            statuses=np.ones(n, np.int64),
            first_arrival_s=np.full(n, now_s),
            arrival_s=np.full(n, now_s),
            event_s=np.full(n, now_s),
            basis=np.full(n, int(Basis.PATH)),
            doubt_m=np.zeros(n),
            reports_within_s=np.zeros(n),
            amounts=np.full(n, np.nan, AMOUNTS),
            forecasts=Forecasts.joined(walk.forecast(t_s) for walk in self.walks.values()),
            destinations=no_stops(n),
            gone=(),
        )
