"""The rigid transform that puts driven places on lines, and how sure it is.

Unknowns: the rotation about the middle of the places, the shift, how far to the left of the lines all drive, and, to
see whether it is 1, the scale. Each line counts as one observation: the robots of one vendor may drive off the line of
the others by the same distance over all its length.
"""

from dataclasses import dataclass

import numpy as np

from ingest.batch import Bools, Floats, Ints
from ingest.frames.driven.driven_places import DrivenPlaces
from ingest.frames.driven.known_lines import KnownLines, OnLines, worth_of

GATES_M = (2.0, 1.5, 1.2, 1.0, 0.9, *[0.8] * 8)
ROBUST_M = 0.15
LEFT_M = 0.4
"""Vendors drive up to about this far apart in one lane."""
BLOCK_M = 8.0
"""Along a line."""
SAME_LINE_M, LINE_SECTORS = 0.9, 24
LEAST_OFF_M, LEAST_BLOCK_M = 0.05, 0.03
"""Lines and blocks of vendors differ by at least this."""
AGREES_M = 0.5
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
    against_m: float
    """Metres driven against the only direction of a line."""
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

        return float(stdtrit(max(self.lines - 4, 1), 0.975))


def rotation(turn_rad: float) -> Floats:
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.array([[c, -s], [s, c]])


def fitted(own: DrivenPlaces, lines: KnownLines, turn_rad: float, shift_m: Floats) -> FittedTransform | None:
    """The best transform near the given one. None if almost nothing lies on a line."""
    worth, left_m = worth_of(own), 0.0
    for gate_m in GATES_M:
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
    on, points_m = _on_lines(own, lines, turn_rad, shift_m, GATES_M[-1])
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
    solved: Floats = np.linalg.solve(normal, design.T @ (wanted * weights))
    return solved


def _moved(turn_rad: float, shift_m: Floats, middle_m: Floats, step: Floats) -> tuple[float, Floats]:
    """The transform after a further rotation about the middle and a shift."""
    turn = rotation(float(step[TURN]))
    return turn_rad + float(step[TURN]), turn @ (shift_m - middle_m) + middle_m + step[SHIFT]


def _with_certainty(
    own: DrivenPlaces, on: OnLines, points_m: Floats, turn_rad: float, shift_m: Floats
) -> FittedTransform:
    worth = worth_of(own)[on.rows]
    middle_m = np.average(points_m[on.rows], axis=0, weights=worth)
    used = ~on.against & (np.abs(on.off_m - np.median(on.off_m)) < AGREES_M)
    used |= ~used.any()
    design, off_m, weights = _design(on, points_m, middle_m)[used], on.off_m[used], worth[used]
    line, block = _lines_and_blocks(on.along[used], on.normals[used], (points_m[on.rows] - middle_m)[used])
    step, covariance = _by_lines(design, off_m, weights, line, block)
    turn_rad, shift_m = _moved(turn_rad, shift_m, middle_m, step)
    left = off_m + design[:, :LEFT] @ step[:LEFT]
    metres = own.metres[on.rows]
    same, against = used & (np.abs(on.off_m) < AGREES_M + LEFT_M), on.against
    return FittedTransform(
        turn_rad=float((turn_rad + np.pi) % (2 * np.pi) - np.pi),
        shift_m=shift_m,
        middle_m=middle_m,
        covariance=covariance,
        scale=1.0 + float(step[SCALE]),
        left_m=-float(step[LEFT]),
        residual_m=float(np.sqrt(np.average(left**2, weights=weights))),
        lines=int(line.max()) + 1,
        common_m=float(metres[same].sum()),
        against_m=float(metres[against].sum()),
        agreement=float(worth[same].sum() - worth[against].sum()),
        reach_m=float(np.quantile(np.hypot(*(points_m[on.rows] - middle_m).T), 0.98)),
    )


def _lines_and_blocks(along: Floats, normals: Floats, arm_m: Floats) -> tuple[Ints, Ints]:
    """(m,) the number of each place's line, and of its block on that line."""
    turn = np.arctan2(along[:, 1], along[:, 0]) % np.pi
    flip = np.where(np.arctan2(along[:, 1], along[:, 0]) % (2 * np.pi) >= np.pi, -1.0, 1.0)
    sector = _sectors(turn)
    line = np.zeros(len(turn), np.int64)
    first = 0
    for number in np.unique(sector):
        rows = np.flatnonzero(sector == number)
        middle = np.angle(np.exp(2j * turn[rows]).mean()) / 2
        across = arm_m[rows] @ (-np.sin(middle), np.cos(middle))
        order = np.argsort(across)
        gap = np.diff(across[order], prepend=across[order[0]]) > SAME_LINE_M / 3
        line[rows[order]] = first + np.cumsum(gap)
        first = int(line[rows].max()) + 1
    along_m = np.einsum("ij,ij->i", arm_m, along) * flip
    block = np.floor(along_m / BLOCK_M).astype(np.int64)
    del normals
    return line, block


def _sectors(turn: Floats) -> Ints:
    width = np.pi / LINE_SECTORS
    sector: Ints = np.rint(turn / width).astype(np.int64) % LINE_SECTORS
    return sector


def _by_lines(
    design: Floats, off_m: Floats, weights: Floats, line: Ints, block: Ints
) -> tuple[Floats, Floats]:
    """The unknowns and their covariance, from the means of blocks with an error of each line and of each block."""
    _, group = np.unique(np.column_stack([line, block]), axis=0, return_inverse=True)
    group = group.ravel()
    total = np.bincount(group, weights)
    means = np.column_stack([np.bincount(group, column * weights) for column in (*design.T, off_m)]) / total[:, None]
    of_line = np.zeros(len(total), np.int64)
    of_line[group] = line
    rows, wanted = means[:, :-1], -means[:, -1]
    share = np.minimum(total / np.median(total), 1.0)
    off_line_m, off_block_m = 0.1, 0.05
    for _ in range(6):
        step, covariance = _generalised(rows, wanted, of_line, off_line_m, off_block_m / np.sqrt(share))
        left = wanted - rows @ step
        off_line_m, off_block_m = _spreads(left, share, of_line)
    return step, covariance


def _generalised(
    rows: Floats, wanted: Floats, of_line: Ints, off_line_m: float, off_block_m: Floats
) -> tuple[Floats, Floats]:
    normal, right = np.diag([1.0, 1e-4, 1e-4, LEFT_M**-2, 0.02**-2]), np.zeros(5)
    for line in np.unique(of_line):
        mine = of_line == line
        x, y, inverse = rows[mine], wanted[mine], 1 / off_block_m[mine] ** 2
        weighted = x * inverse[:, None]
        shrink = off_line_m**2 / (1 + off_line_m**2 * inverse.sum())
        ones_x, ones_y = weighted.sum(axis=0), float((y * inverse).sum())
        normal += x.T @ weighted - shrink * np.outer(ones_x, ones_x)
        right += weighted.T @ y - shrink * ones_x * ones_y
    covariance = np.linalg.inv(normal)
    return covariance @ right, covariance


def _spreads(left: Floats, share: Floats, of_line: Ints) -> tuple[float, float]:
    """How much lines differ, and the blocks of a line, metres."""
    total = np.bincount(of_line, share)
    mean = np.bincount(of_line, left * share) / np.maximum(total, 1e-9)
    blocks = np.bincount(of_line)
    several = int((blocks[blocks > 0] - 1).sum())
    within = float((share * (left - mean[of_line]) ** 2).sum()) / max(several, 1)
    present = blocks > 0
    freedom = max(int(present.sum()) - 4, 1)
    between = float((mean[present] ** 2 * np.minimum(total[present], 1.0)).sum()) / freedom
    return max(LEAST_OFF_M, float(np.sqrt(between))), max(LEAST_BLOCK_M, float(np.sqrt(within)))


def same(a: FittedTransform, b: FittedTransform, apart_m: float = 0.5) -> bool:
    """Whether two transforms put the places at the same place."""
    at = a.middle_m
    back = (at - a.shift_m) @ a.matrix
    turn = abs((a.turn_rad - b.turn_rad + np.pi) % (2 * np.pi) - np.pi)
    off_m = float(np.hypot(*(back @ b.matrix.T + b.shift_m - at)))
    return off_m + turn * a.reach_m / 2 < apart_m


Fits = list[FittedTransform]
Masks = Bools
