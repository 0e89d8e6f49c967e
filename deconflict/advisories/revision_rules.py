"""When a new prediction is worth a revision of a conflict advisory.

`conflict_lifecycle` asks these rules for the few pairs that `watched_pair_kernels` finds. The kernels use the same
thresholds: a prediction that they leave alone is no news by `is_news`.
"""

from math import hypot
from typing import NamedTuple

from deconflict.advisories.conflict_predictions import Prediction
from deconflict.advisories.severity import SLACK_S, SURE, next_severity_change_s
from deconflict.advisory import ConflictAdvisory, Recommendation, Severity, moment
from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter

MOVED_S, MOVED_M, DEEPER_M = 0.75, 1.0, 0.15
"""A larger change of the predicted time, place or separation is worth a revision."""
LIKELIER = 0.15
"""A larger change of the probability is worth a revision."""
HOLD_CHANGED_S = 1.0
"""A hold that differs by no more is the same advice."""
UPDATE_GAP_S = 1.0
"""Shortest time between two revisions, unless severity rises."""
FADES_S = 1.0
"""After a conflict has been unlikely for this long, its advisory is updated to the low probability."""
HELD_SHARE = 0.15
"""An advisory stands until its probability is below this share of `raise_probability`."""


class Weighed(NamedTuple):
    """A prediction that was compared with its advisory and was not worth a revision yet."""

    contact_s: float
    separation_m: float
    sure: bool
    """Whether it was at least as likely as `SURE`."""
    until_s: float
    """From then on, time alone may make it worth a revision."""


def is_news(before: ConflictAdvisory, prediction: Prediction, severity: Severity, met: Encounter, datum: str) -> bool:
    """Whether a person or a site service would act otherwise on the new prediction than on the advisory."""
    return (
        severity != before.severity
        or met.encounter_class != before.encounter_class
        or abs((moment(prediction.contact_s) - before.predicted_at).total_seconds()) > MOVED_S
        or is_likelier(before, prediction.probability)
        or abs(round(prediction.separation_m, 3) - before.min_separation_m) > DEEPER_M
        or datum != before.location.datum
        or hypot(round(met.x_m, 3) - before.location.x, round(met.y_m, 3) - before.location.y) > MOVED_M
    )


def is_likelier(before: ConflictAdvisory, probability: float) -> bool:
    """Whether a person would act otherwise on the new probability, higher or lower."""
    return abs(round(probability, 3) - (before.probability or 0.0)) > LIKELIER


def next_revision_s(advisory: ConflictAdvisory) -> float:
    """When the next revision may be made, unless severity rises."""
    return advisory.updated_at.timestamp() + UPDATE_GAP_S


def weighed(prediction: Prediction, now_s: float, settings: Conflict, until_s: float) -> Weighed:
    """What to remember of a prediction that is not worth a revision before `until_s`."""
    change_s = next_severity_change_s(prediction.contact_s, now_s, settings.warning_s, settings.critical_s, SLACK_S)
    is_sure = prediction.probability >= SURE
    return Weighed(prediction.contact_s, prediction.separation_m, is_sure, min(change_s, until_s))


def held_probability(settings: Conflict) -> float:
    """A less likely conflict lets no advisory stand."""
    return settings.raise_probability * HELD_SHARE


def published_probability(probability: float, settings: Conflict) -> float:
    """The probability that an advisory gives: half of `held_probability` for all that are below it."""
    held = held_probability(settings)
    return probability if probability >= held else held / 2


def advice_differs(before: Recommendation | None, after: Recommendation) -> bool:
    """Whether a site service would act otherwise on the new advice."""
    if before is None:
        return True
    held_s, hold_s = ({hold.robot: hold.hold_s for hold in advice.holds} for advice in (before, after))
    if held_s.keys() != hold_s.keys() or before.note != after.note:
        return True
    return any(abs(held_s[robot] - hold_s[robot]) > HOLD_CHANGED_S for robot in held_s)
