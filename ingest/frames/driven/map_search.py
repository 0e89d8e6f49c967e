"""The transform of a frame, proposed from driving, or why none is proposed."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ingest.batch import Floats
from ingest.frames.driven.driven_places import DrivenPlaces
from ingest.frames.driven.known_lines import CELL_M, KnownLines
from ingest.frames.driven.line_fit import GATES_M, ROUGH_GATES_M, SCALE, TURN, FittedTransform, fitted, rotation, same
from ingest.frames.driven.shared_moments import MomentIndex, Moments, Overlaps

RASTER_CELL_M, MOST_CELLS = 0.5, 700
"""Of the rasters: larger floors get larger cells."""
TURNS = 180
"""Directions of aisles are compared degree by degree, up to half a turn."""
SPREAD_DEG = 1.5
ROUND_SHARE = 0.35
"""If the directions of the best turn agree by no more than this beyond the mean, all turns are tried."""
NEAR_BEST_TURN = 0.4
EVERY_DEG = 3
PER_TURN, IN_ALL = 12, 60
PEAK_M = 2.5
LEAST_SHARE = 0.4
"""Of the best overlap."""


@dataclass(frozen=True, slots=True)
class RoughTransform:
    """A rotation, and then a shift."""

    turn_rad: float
    shift_m: tuple[float, float]
    overlap: float


def rough_transforms(own: DrivenPlaces, known: DrivenPlaces) -> list[RoughTransform]:
    """From the frame of `own` to that of `known`, best first."""
    raster, found = _Raster(own, known), list[RoughTransform]()
    for turn_deg in _turns_deg(own, known):
        found += raster.peaks(np.radians(turn_deg))
    found.sort(key=lambda rough: -rough.overlap)
    return [rough for rough in found[:IN_ALL] if rough.overlap >= LEAST_SHARE * found[0].overlap]


def _turns_deg(own: DrivenPlaces, known: DrivenPlaces) -> list[float]:
    """Turns under which directions agree, whichever way they are driven."""
    histograms = [np.fft.rfft(_directions(places)) for places in (own, known)]
    agreement = np.fft.irfft(histograms[1] * histograms[0].conj(), TURNS)
    rise, top = agreement - agreement.mean(), agreement.max() - agreement.mean()
    if top < ROUND_SHARE * agreement.mean():
        return [float(turn) for turn in range(0, 360, EVERY_DEG)]
    around = [np.roll(rise, by) for by in (-2, -1, 1, 2)]
    peaks = np.flatnonzero((rise >= np.max(around, axis=0)) & (rise >= NEAR_BEST_TURN * top))
    half = [float(peak + by) for peak in peaks for by in (-0.75, 0.0, 0.75)]
    return [*half, *(turn + 180.0 for turn in half)]


def _directions(places: DrivenPlaces) -> Floats:
    """(180,) how much is driven in each direction, modulo half a turn, smoothed."""
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415 - only proposals need it

    degrees = np.degrees(np.arctan2(places.headings[:, 1], places.headings[:, 0])) % TURNS
    counts = np.bincount(np.rint(degrees).astype(np.int64) % TURNS, np.sqrt(places.metres), TURNS)
    smoothed: Floats = gaussian_filter1d(counts, SPREAD_DEG, mode="wrap")
    return smoothed


class _Raster:
    """Driven places as complex numbers in cells: twice the direction as angle, so that it does not count which way."""

    def __init__(self, own: DrivenPlaces, known: DrivenPlaces) -> None:
        from scipy import fft  # noqa: PLC0415 - only proposals need it
        from scipy.ndimage import gaussian_filter  # noqa: PLC0415

        self._fft, self._own = fft, own
        self._middle_m = own.points_m.mean(axis=0)
        reach_m = float(np.hypot(*(own.points_m - self._middle_m).T).max())
        self._first_m = known.points_m.min(axis=0)
        extent_m = np.ptp(known.points_m, axis=0)
        self._cell_m = max(RASTER_CELL_M, float(extent_m.max() + 2 * reach_m) / MOST_CELLS)
        self._side = int(2 * reach_m / self._cell_m) + 3
        shape = (extent_m / self._cell_m).astype(int) + 1 + self._side
        self._shape = tuple(fft.next_fast_len(int(side)) for side in shape)
        field = self._field(known, known.points_m - self._first_m, self._shape)
        field = gaussian_filter(field.real, 1.0) + 1j * gaussian_filter(field.imag, 1.0)
        self._known = fft.fft2(field.astype(np.complex64))

    def _field(self, places: DrivenPlaces, points_m: Floats, shape: tuple[int, ...]) -> Floats:
        columns, rows = (points_m / self._cell_m).astype(np.int64).T
        cells, size = columns * shape[1] + rows, shape[0] * shape[1]
        value = np.sqrt(places.metres) * (places.headings[:, 0] + 1j * places.headings[:, 1]) ** 2
        field = np.bincount(cells, value.real, size) + 1j * np.bincount(cells, value.imag, size)
        return (field / np.sqrt(np.maximum(np.abs(field), 1.0))).reshape(shape)

    def peaks(self, turn_rad: float) -> Iterator[RoughTransform]:
        from scipy.ndimage import maximum_filter  # noqa: PLC0415 - only proposals need it

        matrix = rotation(turn_rad)
        turned = self._own.placed(matrix, np.zeros(2))
        middle = matrix @ self._middle_m
        corner_m = middle - self._side // 2 * self._cell_m
        own = self._fft.fft2(self._field(turned, turned.points_m - corner_m, self._shape).astype(np.complex64))
        overlap = self._fft.ifft2(self._known * own.conj()).real
        highest = maximum_filter(overlap, max(3, round(PEAK_M / self._cell_m)), mode="wrap")
        peaks = np.argwhere((overlap == highest) & (overlap > 0))
        values = overlap[tuple(peaks.T)]
        for row in np.argsort(-values)[:PER_TURN]:
            cells = peaks[row] - np.where(peaks[row] > np.array(self._shape) - self._side, self._shape, 0)
            shift = self._first_m + cells * self._cell_m - corner_m
            yield RoughTransform(float(turn_rad), (float(shift[0]), float(shift[1])), float(values[row]))


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
