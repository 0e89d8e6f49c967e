"""Where the levels of an Open-RMF building file lie: from the unit of each drawing to metres of the reference level.

Open-RMF's own tools scale the reference level by its measurements, and turn, scale and shift each other level so that
fiducials of the same name lie above each other: by the circular mean of the turns and the mean of the scales between
all pairs of them. Robots of Open-RMF report in that frame, so the same means are taken here, not a best fit. Where
levels have no two fiducials in common, each keeps its own frame, scaled by its own measurements.
"""

import cmath
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import fmean

from deconflict.settings.importers.formats.openrmf.rmf_entries import PlanLevel, number
from deconflict.settings.importers.plan import PlanError, Spot

RESIDUAL_M = 0.25
"""A fiducial farther from the one of its name is a fault."""
DOUBTED, REFUSED = 0.02, 0.1
"""Shares by which scales of one level may differ: beyond the first it is said, beyond the second refused."""


@dataclass(frozen=True, slots=True)
class LevelFrame:
    """The frame of one level."""

    to_metres: Callable[[Spot], Spot]
    turn_rad: float = 0.0
    is_shared: bool = True
    """Whether what lies above each other has the same x and y as on the reference level."""


@dataclass(frozen=True, slots=True)
class Alignment:
    """A turn, a scale and a shift of points as complex numbers."""

    factor: complex
    shift: complex = 0j

    def __call__(self, at: Spot) -> Spot:
        placed = self.factor * complex(*at) + self.shift
        return placed.real, placed.imag


def metric_frames(levels: Mapping[str, PlanLevel]) -> tuple[dict[str, LevelFrame], list[str]]:
    """The frames of levels in metres, and what is doubtful."""
    doubts: list[str] = []
    for level in levels.values():
        _compare(f"levels.{level.name}: its measurements and its metres", _measured(level, doubts), 1.0, doubts)
    return {name: LevelFrame(lambda at: at) for name in levels}, doubts


def drawn_frames(levels: Mapping[str, PlanLevel], reference: str) -> tuple[dict[str, LevelFrame], list[str]]:
    """The frames of levels in pixels, and what is doubtful. Raises `PlanError` where the geometry would be wrong."""
    doubts: list[str] = []
    scales = {name: _measured(level, doubts) for name, level in levels.items()}
    frames: dict[str, LevelFrame] = {}
    for name, level in levels.items():
        common = sorted(levels[reference].fiducials.keys() & level.fiducials.keys())
        if name != reference and len(common) > 1:
            fitted = _aligned(levels[reference], level, common, _known(scales[reference], reference))
            _compare(f"levels.{name}: its measurements and fiducials", scales[name], abs(fitted.factor), doubts)
            frames[name] = LevelFrame(fitted, cmath.phase(fitted.factor))
        elif level.vertices:
            scale = _known(scales[name], name, reference)
            frames[name] = LevelFrame(Alignment(complex(scale)), is_shared=name == reference)
    apart = [name for name, frame in frames.items() if not frame.is_shared]
    if apart:
        doubts.append(
            f"{' and '.join(apart)}: no two fiducials in common with the reference level {reference}; each floor keeps"
            " its own origin, so x and y of one floor are not those of another"
        )
    return {name: frames.get(name, LevelFrame(Alignment(1 + 0j))) for name in levels}, doubts


def _known(scale: float | None, name: str, reference: str = "") -> float:
    if scale is None and reference not in {"", name}:
        raise PlanError(
            f"levels.{name}: has neither measurements nor two fiducials in common with the reference level {reference};"
            " measure a distance on it in the traffic editor, or set fiducials of the same names on both"
        )
    if scale is None:
        raise PlanError(f"levels.{name}.measurements: is missing; measure a distance in the traffic editor")
    return scale


def _measured(level: PlanLevel, doubts: list[str]) -> float | None:
    """Metres of a pixel: the mean over the measurements, as in the traffic editor's own export."""
    scales = []
    for row, edge in enumerate(level.measurements):
        where = f"levels.{level.name}.measurements.{row}"
        metres = number(edge.properties.get("distance"), f"{where}, distance")
        start, end = (complex(*level.vertices[vertex].at) for vertex in (edge.start, edge.end))
        if metres <= 0 or start == end:
            raise PlanError(f"{where}: must be a distance above 0 between two places; delete it")
        scales.append(metres / abs(end - start))
    if not scales:
        return None
    mean = fmean(scales)
    worst = max(scales, key=lambda scale: abs(scale / mean - 1))
    others = f"levels.{level.name}.measurements: {scales.index(worst)} and the mean"
    _compare(others, worst, mean, doubts)
    return mean


def _compare(what: str, found: float | None, wanted: float, doubts: list[str]) -> None:
    differ = abs(found / wanted - 1) if found else 0.0
    if differ > REFUSED:
        raise PlanError(f"{what} contradict each other by {differ:.0%}; correct or delete what is wrong")
    if differ > DOUBTED:
        doubts.append(f"{what} differ by {differ:.1%}; distances on that floor may be wrong by as much")


def _aligned(reference: PlanLevel, level: PlanLevel, common: Sequence[str], scale: float) -> Alignment:
    wanted = [complex(*reference.fiducials[name]) for name in common]
    found = [complex(*level.fiducials[name]) for name in common]
    turns, ratios = [], []
    for first, second in combinations(range(len(common)), 2):
        above, below = found[second] - found[first], wanted[second] - wanted[first]
        if not above or not below:
            at = level.name if not above else reference.name
            both = f"{common[first]!r} and {common[second]!r}"
            raise PlanError(f"levels.{at}.fiducials: {both} are at the same place; move or delete one")
        turns.append(cmath.phase(below / above))
        ratios.append(abs(above) / abs(below))
    turn = cmath.phase(sum(cmath.rect(1, each) for each in turns))
    factor = cmath.rect(scale / fmean(ratios), turn)
    shift = scale * sum(wanted) / len(wanted) - factor * sum(found) / len(found)
    off_m = {
        name: abs(factor * at + shift - scale * place) for name, at, place in zip(common, found, wanted, strict=True)
    }
    worst = max(off_m, key=lambda name: off_m[name])
    if off_m[worst] > RESIDUAL_M:
        raise PlanError(
            f"levels.{level.name}.fiducials: do not fit those of the reference level {reference.name}:"
            f" {worst!r} is {off_m[worst]:.2f} m off; correct or delete what is wrong"
        )
    return Alignment(factor, shift)
