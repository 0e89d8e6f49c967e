"""The transform of a frame, proposed from driving, or why none is proposed."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ingest.frames.driven.driven_places import DrivenPlaces
from ingest.frames.driven.known_lines import CELL_M, KnownLines
from ingest.frames.driven.line_fit import GATES_M, ROUGH_GATES_M, SCALE, TURN, FittedTransform, fitted, same
from ingest.frames.driven.raster_search import rough_transforms
from ingest.frames.driven.shared_moments import MomentIndex, Moments, Overlaps

WITHIN_M, WITHIN_RAD = 0.2, np.radians(1.0)
"""A proposal is at most so uncertain (95 %)."""
RIVAL_SHARE = 0.8
"""Another transform that explains this share of what the best explains is a rival."""
WORTH_TRYING, ROUGH_PLACES, MOST_TRIALS = 0.35, 800, 24
LEAST_COMMON_M = 100.0
LEAST_LINES = 4
STRETCH = 0.003
"""A scale that differs from 1 by more is a stretched map."""


class Doubt(StrEnum):
    """Why nothing is proposed."""

    LITTLE = "little"
    """Too few metres driven in common."""
    OPEN = "open"
    """A shift or turn is left open, as along a single aisle."""
    LIKENESS = "likeness"
    """Another transform fits as well."""
    APART = "apart"
    """Nothing shows that the robots meet: they drive at other times or places."""
    STRETCHED = "stretched"
    """A scale fits better than none: the map is stretched, or lanes differ."""
    MIRRORED = "mirrored"


@dataclass(frozen=True, slots=True, eq=False)
class DrivenFrame:
    """What was driven in one frame."""

    places: DrivenPlaces
    moments: Moments


@dataclass(frozen=True, slots=True, eq=False)
class FoundMap:
    """The answer for one frame."""

    fit: FittedTransform | None
    """The best transform, proposed or not."""
    overlaps: Overlaps | None
    doubt: Doubt | None
    """None if the transform is proposed."""


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    fit: FittedTransform
    overlaps: Overlaps


def found_map(own: DrivenFrame, known: DrivenFrame) -> FoundMap:
    """From the frame of `own` to that of `known`."""
    found = _found(own, known)
    if found.doubt is None or found.doubt is Doubt.STRETCHED:
        return found
    flip = np.diag([1.0, -1.0])
    mirrored = DrivenFrame(own.places.placed(flip, np.zeros(2)), own.moments.placed(flip, np.zeros(2)))
    other = _found(mirrored, known)
    return FoundMap(other.fit, other.overlaps, Doubt.MIRRORED) if other.doubt is None else found


def _found(own: DrivenFrame, known: DrivenFrame) -> FoundMap:
    if min(frame.places.metres.sum() for frame in (own, known)) < LEAST_COMMON_M:
        return FoundMap(None, None, Doubt.LITTLE)
    trials = list(_trials(own, known))
    if not trials:
        return FoundMap(None, None, Doubt.LITTLE)
    shown = [trial for trial in trials if trial.overlaps.shows_same_floor]
    if not shown:
        unsure = _doubt(trials[0].fit) or (Doubt.LIKENESS if _is_rivalled(trials[0], trials) else Doubt.APART)
        return FoundMap(trials[0].fit, trials[0].overlaps, unsure)
    best = shown[0]
    doubt = _doubt(best.fit) or (Doubt.LIKENESS if _is_rivalled(best, trials) else None)
    return FoundMap(best.fit, best.overlaps, doubt)


def _trials(own: DrivenFrame, known: DrivenFrame) -> Iterator[_Trial]:
    """The transforms that come into question, the best first."""
    lines, places = KnownLines(known.places), own.places.coarser(CELL_M)
    few = places.some(ROUGH_PLACES)
    begun = [
        fitted(few, lines, rough.turn_rad, np.array(rough.shift_m), ROUGH_GATES_M)
        for rough in rough_transforms(own.places, known.places)
    ]
    finished = [fitted(places, lines, fit.turn_rad, fit.shift_m, GATES_M) for fit in _best(begun)]
    index = MomentIndex(known.moments)
    for fit in _best(finished):
        yield _Trial(fit, index.overlaps(own.moments.placed(fit.matrix, fit.shift_m)))


def _best(fits: Iterable[FittedTransform | None]) -> list[FittedTransform]:
    """Those that explain most, each once."""
    kept: list[FittedTransform] = []
    for fit in sorted((fit for fit in fits if fit), key=lambda fit: -fit.agreement):
        if fit.agreement < max(WORTH_TRYING * kept[0].agreement if kept else 0, 1e-9):
            break
        if not any(same(fit, other) for other in kept):
            kept.append(fit)
    return kept[:MOST_TRIALS]


def _is_rivalled(best: _Trial, trials: list[_Trial]) -> bool:
    return any(
        trial is not best and trial.fit.agreement >= RIVAL_SHARE * best.fit.agreement and not trial.overlaps.refutes
        for trial in trials
    )


def _doubt(fit: FittedTransform) -> Doubt | None:
    """Why this transform by itself is not certain."""
    if fit.common_m < LEAST_COMMON_M:
        return Doubt.LITTLE
    error_rad = fit.sure_within * float(np.sqrt(fit.covariance[TURN, TURN]))
    if fit.lines < LEAST_LINES or fit.error_m(fit.reach_m) > WITHIN_M or error_rad > WITHIN_RAD:
        return Doubt.OPEN
    scale_error = fit.sure_within * float(np.sqrt(fit.covariance[SCALE, SCALE]))
    if abs(fit.scale - 1) > max(STRETCH, scale_error):
        return Doubt.STRETCHED
    return None
