"""How much a prediction must differ from a conflict advisory to be worth a revision.

The kernels of `watched_pair_kernels` compile `is_likelier` and `published_probability`.
"""

from math import hypot

from deconflict.settings.site import Conflict
from deconflict.sweep.geometry.encounter import Encounter
from deconflict_client.advisory import Action, ConflictAdvisory, Recommendation

MOVED_S, MOVED_M, DEEPER_M = 0.75, 1.0, 0.15
"""A larger change of the predicted time, place or separation is worth a revision."""
LIKELIER = 0.15
"""A larger change of the probability is worth a revision."""
HOLD_CHANGED_S = 1.0
"""A hold that differs by no more is the same advice."""
ROUNDED = 1e-3
"""Advisories give probabilities rounded to this."""
UPDATE_GAP_S = 1.0
"""Shortest time between two revisions, unless the severity changes."""
HELD_SHARE = 0.15
"""An advisory stands until its probability is below this share of `raise_probability`."""


def is_likelier(probability: float, advised: float) -> bool:
    """Whether a person would act otherwise on this probability than on that of an advisory, higher or lower."""
    return abs(round(probability, 3) - advised) > LIKELIER


def is_elsewhere(before: ConflictAdvisory, met: Encounter, datum: str) -> bool:
    """Whether a person would act otherwise on how and where the two meet than on the advisory."""
    return (
        met.encounter_class != before.encounter_class
        or datum != before.location.datum
        or hypot(round(met.x_m, 3) - before.location.x, round(met.y_m, 3) - before.location.y) > MOVED_M
    )


def held_probability(settings: Conflict) -> float:
    """A less likely conflict lets no advisory stand."""
    return settings.raise_probability * HELD_SHARE


def published_probability(probability: float, held: float) -> float:
    """The probability that an advisory gives: half of `held_probability` for all that are below it."""
    return probability if probability >= held else held / 2


def advice_differs(before: Recommendation | None, after: Recommendation) -> bool:
    """Whether a site service would act otherwise on the new advice."""
    if before is None:
        return True
    held_s, hold_s = ({hold.robot: hold.hold_s for hold in advice.holds} for advice in (before, after))
    if held_s.keys() != hold_s.keys() or before.note != after.note:
        return True
    if any(abs(held_s[robot] - hold_s[robot]) > HOLD_CHANGED_S for robot in held_s):
        return True
    return len(before.actions) != len(after.actions) or any(map(_action_differs, before.actions, after.actions))


def _action_differs(before: Action, after: Action) -> bool:
    if (before.robot, before.action, before.where) != (after.robot, after.action, after.where):
        return True
    longer_s = abs((before.seconds or 0.0) - (after.seconds or 0.0))
    return longer_s > HOLD_CHANGED_S or before.speed_mps != after.speed_mps
