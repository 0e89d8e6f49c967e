"""The rigid transform that puts driven places on lines, and how sure it is.

Unknowns: the rotation about the middle of the places, the shift, how far to the left of the lines all drive, and, to
see whether it is 1, the scale. Each line counts as one observation: the robots of one vendor may drive off the line of
the others by the same distance over all its length.
"""

from dataclasses import dataclass

import numpy as np

from ingest.batch import Floats, Ints
from ingest.frames.driven.driven_places import DrivenPlaces
from ingest.frames.driven.known_lines import KnownLines, OnLines, worth_of

ROUGH_GATES_M, GATES_M = (2.0, 1.5, 1.2, 1.0, 0.8), (0.8, 0.8, 0.8, 0.8)
ROBUST_M = 0.15
LEFT_M = 0.4
"""Vendors drive up to about this far apart in one lane."""
BLOCK_M = 8.0
"""Along a line."""
SAME_LINE_M, LINE_SECTORS = 4.0, 4
MAIN_SHARE = 0.15
WHOLE_LINE = 0.5
"""Lines on which this share of what is driven on the longest is driven count fully: bays beside an aisle do not."""
LEAST_OFF_M, LEAST_BLOCK_M = 0.1, 0.05
"""Lines and blocks of vendors differ by at least this."""
AGREES_M = 0.5
PRIORS = np.array([1.0, 100.0, 100.0, LEFT_M, 0.02])
"""Of the unknowns, before anything is driven: standard errors."""
CAUTION = 1.5
"""Errors are larger than lines by themselves show: two aisles may be off by the same (`benchmarks/driven_maps.py`)."""
TURN, SHIFT, LEFT, SCALE = 0, slice(1, 3), 3, 4


@dataclass(frozen=True, slots=True, eq=False)
class FittedTransform:
    """A rotation and then a shift, with what speaks for it."""

    turn_rad: float
    shift_m: Floats
    """(2,)"""
    middle_m: Floats
    """(2,) of the places on lines, in the known frame."""
    covariance: Floats
    """(5, 5) of the unknowns. The rotation is in radians about the middle."""
    scale: float
    left_m: float
    """How far to the left of the known lines these robots drive."""
    residual_m: float
    """Usual distance from the lines, root mean square."""
    lines: int
    common_m: float
    """Metres driven on lines of the known frame, in their direction."""
    agreement: float
    """Worth of the places on lines, less those driven against them."""
    reach_m: float
    """How far the places on lines are from their middle."""

    @property
    def matrix(self) -> Floats:
        return rotation(self.turn_rad)

    def error_m(self, at_m: float) -> float:
        """Uncertainty of a position so far from the middle, metres (95 %)."""
        shift2 = float(np.linalg.eigvalsh(self.covariance[SHIFT, SHIFT])[-1])
        return self.sure_within * float(np.sqrt(shift2 + self.covariance[TURN, TURN] * at_m**2))

    @property
    def sure_within(self) -> float:
        """Standard errors within which 95 % lie: more, the fewer lines there are."""
        from scipy.special import stdtrit  # noqa: PLC0415 - only proposals need it

        return CAUTION * float(stdtrit(max(self.lines - 4, 1), 0.975))


def rotation(turn_rad: float) -> Floats:
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.array([[c, -s], [s, c]])


def fitted(
    own: DrivenPlaces, lines: KnownLines, turn_rad: float, shift_m: Floats, gates_m: tuple[float, ...]
) -> FittedTransform | None:
    """The best transform near the given one. None if almost nothing lies on a line."""
    worth, left_m = worth_of(own), 0.0
    for gate_m in gates_m:
        on, points_m = _on_lines(own, lines, turn_rad, shift_m, gate_m)
        if len(on.rows) < 20:
            return None
        middle_m = np.average(points_m[on.rows], axis=0, weights=worth[on.rows])
        design = _design(on, points_m, middle_m)
        off_m = on.off_m
        weights = worth[on.rows] * np.where(on.against, 0.3, 1.0) / (1 + ((off_m - left_m) / ROBUST_M) ** 2)
        step = _solved(design[:, :SCALE], -off_m, weights)
        left_m = -float(step[LEFT])
        turn_rad, shift_m = _moved(turn_rad, shift_m, middle_m, step)
    on, points_m = _on_lines(own, lines, turn_rad, shift_m, gates_m[-1])
    if len(on.rows) < 20:
        return None
    return _with_certainty(own, on, points_m, turn_rad, shift_m)


def _on_lines(
    own: DrivenPlaces, lines: KnownLines, turn_rad: float, shift_m: Floats, gate_m: float
) -> tuple[OnLines, Floats]:
    placed = own.placed(rotation(turn_rad), shift_m)
    return lines.of(placed.points_m, placed.headings, gate_m), placed.points_m


def _design(on: OnLines, points_m: Floats, middle_m: Floats) -> Floats:
    """(m, 5) by how much each unknown moves a place to the left of its line."""
    arm_m = points_m[on.rows] - middle_m
    turned = np.column_stack([-arm_m[:, 1], arm_m[:, 0]])
    by_turn, by_scale = (np.einsum("ij,ij->i", on.normals, by) for by in (turned, arm_m))
    return np.column_stack([by_turn, on.normals, np.ones(len(arm_m)), by_scale])


def _solved(design: Floats, wanted: Floats, weights: Floats) -> Floats:
    """Least squares. What the lines leave open stays as it is."""
    normal = design.T @ (design * weights[:, None])
    total = float(weights.sum())
    normal[np.diag_indices(len(normal))] += total * np.array([1e-2, 1e-4, 1e-4, 0.02])[: len(normal)]
    return np.linalg.solve(normal, design.T @ (wanted * weights)).astype(np.float64)


def _moved(turn_rad: float, shift_m: Floats, middle_m: Floats, step: Floats) -> tuple[float, Floats]:
    """The transform after a further rotation about the middle and a shift."""
    moved_m = rotation(float(step[TURN])) @ (shift_m - middle_m) + middle_m + step[SHIFT]
    return turn_rad + float(step[TURN]), moved_m.astype(np.float64)


def _with_certainty(
    own: DrivenPlaces, on: OnLines, points_m: Floats, turn_rad: float, shift_m: Floats
) -> FittedTransform:
    worth = worth_of(own)[on.rows]
    middle_m = np.average(points_m[on.rows], axis=0, weights=worth)
    used = ~on.against & (np.abs(on.off_m - np.median(on.off_m)) < AGREES_M)
    used |= ~used.any()
    design, off_m, weights = _design(on, points_m, middle_m)[used], on.off_m[used], worth[used]
    line, block = _lines_and_blocks(on.along[used], (points_m[on.rows] - middle_m)[used], weights)
    main = line >= 0
    line = np.unique(line[main], return_inverse=True)[1]
    step, covariance, count = _by_lines(design[main], off_m[main], weights[main], line, block[main])
    turn_rad, shift_m = _moved(turn_rad, shift_m, middle_m, step)
    left = off_m + design[:, :LEFT] @ step[:LEFT]
    same = used & (np.abs(on.off_m) < AGREES_M + LEFT_M)
    return FittedTransform(
        turn_rad=float((turn_rad + np.pi) % (2 * np.pi) - np.pi),
        shift_m=shift_m,
        middle_m=middle_m,
        covariance=covariance,
        scale=1.0 + float(step[SCALE]),
        left_m=-float(step[LEFT]),
        residual_m=float(np.sqrt(np.average(left**2, weights=weights))),
        lines=int(count),
        common_m=float(own.metres[on.rows][same].sum()),
        agreement=float(worth[same].sum() - worth[on.against].sum()),
        reach_m=float(np.quantile(np.hypot(*(points_m[on.rows] - middle_m).T), 0.98)),
    )


def _lines_and_blocks(along: Floats, arm_m: Floats, weights: Floats) -> tuple[Ints, Ints]:
    """(m,) the number of each place's line, and of its block on that line. The lanes of an aisle are one line.

    A place in a direction in which little is driven, as in a turn, is on no line: -1.
    """
    turn = np.arctan2(along[:, 1], along[:, 0])
    axes_rad = np.angle(np.average(np.exp(4j * turn), weights=weights)) / 4
    sector = np.rint((turn - axes_rad) * LINE_SECTORS / np.pi).astype(np.int64) % LINE_SECTORS
    middle = np.array([_mean_line(turn[sector == number]) for number in range(LINE_SECTORS)])[sector]
    across_m = arm_m[:, 1] * np.cos(middle) - arm_m[:, 0] * np.sin(middle)
    along_m = arm_m[:, 0] * np.cos(middle) + arm_m[:, 1] * np.sin(middle)
    strips = np.column_stack([sector, np.floor(across_m / SAME_LINE_M)])
    line = np.unique(strips, axis=0, return_inverse=True)[1].ravel()
    driven = np.bincount(sector, weights, LINE_SECTORS)
    line[(driven < MAIN_SHARE * driven.sum())[sector]] = -1
    return line, np.floor(along_m / BLOCK_M).astype(np.int64)


def _mean_line(turns: Floats) -> float:
    """The mean of directions modulo half a turn."""
    return float(np.angle(np.exp(2j * turns).mean()) / 2) if len(turns) else 0.0


def _by_lines(design: Floats, off_m: Floats, weights: Floats, line: Ints, block: Ints) -> tuple[Floats, Floats, float]:
    """The unknowns, their covariance, and how many lines there are, of which short ones count less.

    They are found from the means of blocks, with an error of each line and of each block.
    """
    _, group = np.unique(np.column_stack([line, block]), axis=0, return_inverse=True)
    group = group.ravel()
    total = np.bincount(group, weights)
    means = np.column_stack([np.bincount(group, column * weights) for column in (*design.T, off_m)]) / total[:, None]
    of_line = np.zeros(len(total), np.int64)
    of_line[group] = line
    rows, wanted = means[:, :-1], -means[:, -1]
    share, driven = np.minimum(total / np.median(total), 1.0), np.bincount(line, weights)
    line_share = np.minimum(driven / (WHOLE_LINE * driven.max()), 1.0)
    spread_m = 0.1, 0.05
    for _ in range(6):
        variances = spread_m[0] ** 2 / line_share, spread_m[1] ** 2 / share
        step, covariance = _generalised(rows, wanted, of_line, *variances)
        spread_m = _spreads(wanted - rows @ step, share, of_line, line_share)
    return step, covariance, float(line_share.sum())


def _generalised(
    rows: Floats, wanted: Floats, of_line: Ints, of_lines_m2: Floats, of_blocks_m2: Floats
) -> tuple[Floats, Floats]:
    """Least squares with errors that the blocks of a line have in common, and the covariance."""
    inverse, both = 1 / of_blocks_m2, np.column_stack([rows, wanted])
    sums = np.column_stack([np.bincount(of_line, column * inverse) for column in both.T])
    shrink = of_lines_m2 / (1 + of_lines_m2 * np.bincount(of_line, inverse))
    normal = both.T @ (both * inverse[:, None]) - sums.T @ (sums * shrink[:, None])
    covariance = np.linalg.inv(normal[:-1, :-1] + np.diag(PRIORS**-2.0)).astype(np.float64)
    found: Floats = covariance @ normal[:-1, -1]
    return found, covariance


def _spreads(left: Floats, share: Floats, of_line: Ints, line_share: Floats) -> tuple[float, float]:
    """How much lines differ, and the blocks of a line, metres."""
    total, blocks = np.bincount(of_line, share), np.bincount(of_line)
    mean = np.bincount(of_line, left * share) / total
    within = float((share * (left - mean[of_line]) ** 2).sum()) / max(int((blocks - 1).sum()), 1)
    freedom = max(1 - 4 / line_share.sum(), 0.1)
    between = float(np.average(mean**2, weights=line_share)) / freedom
    return max(LEAST_OFF_M, float(np.sqrt(between))), max(LEAST_BLOCK_M, float(np.sqrt(within)))


def same(a: FittedTransform, b: FittedTransform, apart_m: float = 0.5) -> bool:
    """Whether two transforms put the places at the same place."""
    at = a.middle_m
    back = (at - a.shift_m) @ a.matrix
    turn = abs((a.turn_rad - b.turn_rad + np.pi) % (2 * np.pi) - np.pi)
    off_m = float(np.hypot(*(back @ b.matrix.T + b.shift_m - at)))
    return off_m + turn * a.reach_m / 2 < apart_m
