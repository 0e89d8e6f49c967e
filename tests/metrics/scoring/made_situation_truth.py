"""What happened in a log in which nothing happens, to judge situations by."""

from math import inf

from metrics.scoring.situation_scores import SituationTruth
from metrics.truth.advised_waits import AdvisedWaits

END_S = 120.0
NOBODY_LEFT = SituationTruth(
    span_s=END_S,
    robot_hours=0.5,
    outcomes={},
    lasting_s={},
    advised={},
    others={},
    waits=AdvisedWaits(),
    left_s=lambda *_: inf,
)
