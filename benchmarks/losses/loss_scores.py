"""Compares found losses with true ones, by pair and by time."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.losses.true_losses import LostByLabel, LostBySecond
from deconflict.foresight.losses.loss import Loss
from deconflict.foresight.losses.loss_places import PlacedLoss

APART_S = 8
"""True and found losses of a pair belong to one case if they are less than this apart."""

MINUTE_S = 60

Seconds = Mapping[int, float]
"""By whole second, the lost seconds."""


@dataclass(slots=True)
class LossScore:
    """Sums of lost seconds."""

    true_s: float = 0.0
    found_s: float = 0.0
    right_s: float = 0.0
    """Found, and true: of each case the smaller sum."""

    @property
    def share_found(self) -> float:
        """Of the true seconds, the share that is found."""
        return self.right_s / self.true_s if self.true_s else float("nan")

    @property
    def share_invented(self) -> float:
        """Of the found seconds, the share that is not true."""
        return 1.0 - self.right_s / self.found_s if self.found_s else float("nan")

    def add(self, true: Seconds, found: Seconds) -> None:
        for first, end in _cases(true, found):
            true_s = sum(lost_s for second, lost_s in true.items() if first <= second <= end)
            found_s = sum(lost_s for second, lost_s in found.items() if first <= second <= end)
            self.true_s, self.found_s = self.true_s + true_s, self.found_s + found_s
            self.right_s += max(min(true_s, found_s), 0.0)


def _cases(true: Seconds, found: Seconds) -> Iterator[tuple[int, int]]:
    """The first and the last second of each case."""
    seconds = sorted({*true, *found})
    first = 0
    for at in range(1, len(seconds) + 1):
        if at == len(seconds) or seconds[at] - seconds[at - 1] > APART_S:
            yield seconds[first], seconds[at - 1]
            first = at


def against_usual(placed: PlacedLoss) -> PlacedLoss:
    """The same loss with its seconds against the usual time of its model."""
    return placed._replace(loss=placed.loss._replace(lost_s=placed.loss.over_usual_s))


def by_second(losses: Iterable[Loss], rows: Mapping[str, int], start_s: float) -> LostBySecond:
    """Each loss spread evenly over its time. `rows` are the robots' rows in the world; others count as the cause -2."""
    found: LostBySecond = defaultdict(lambda: defaultdict(float))
    for loss in losses:
        robot, by = rows.get(loss.robot, -2), rows.get(loss.by, -2)
        first, end = int(loss.from_s - start_s), int(loss.until_s - start_s)
        for second in range(first, max(end, first + 1)):
            found[robot, by][second] += loss.lost_s / max(end - first, 1)
    return found


def score_pairs(true: LostBySecond, found: LostBySecond, robots: Iterable[int]) -> LossScore:
    """The losses of these robots, with the right other robot."""
    score, wanted = LossScore(), set(robots)
    for pair in sorted({*true, *found}):
        if pair[0] in wanted:
            score.add(true.get(pair, {}), found.get(pair, {}))
    return score


def score_robots(true: LostBySecond, found: LostBySecond, robots: Iterable[int]) -> LossScore:
    """The losses of these robots, whatever the other robot."""
    score, true_of, found_of = LossScore(), _by_robot(true), _by_robot(found)
    for robot in robots:
        score.add(true_of[robot], found_of[robot])
    return score


def by_vendor(lost: LostBySecond, robots: Iterable[int], vendors: Mapping[int, int]) -> LostBySecond:
    """The losses of these robots by minute, and by the vendors of the two robots; -1 for a robot that is not known."""
    joined: LostBySecond = defaultdict(lambda: defaultdict(float))
    for robot in robots:
        for pair in [pair for pair in lost if pair[0] == robot]:
            key = vendors.get(robot, -1), vendors.get(pair[1], -1)
            for second, lost_s in lost[pair].items():
                joined[key][second // MINUTE_S] += lost_s
    return joined


def score_vendors(
    true: LostBySecond, found: LostBySecond, robots: Sequence[int], vendors: Mapping[int, int]
) -> LossScore:
    """The sums of each pair of vendors, minute by minute."""
    score = LossScore()
    true, found = by_vendor(true, robots, vendors), by_vendor(found, robots, vendors)
    for pair in {*true, *found}:
        for minute in {*true.get(pair, ()), *found.get(pair, ())}:
            score.add({0: true[pair][minute]}, {0: found[pair][minute]})
    return score


def by_label(losses: Iterable[tuple[str, Loss]], start_s: float) -> LostByLabel:
    """As `by_second`, by the label of each loss."""
    found: LostByLabel = defaultdict(lambda: defaultdict(float))
    for label, loss in losses:
        first, end = int(loss.from_s - start_s), int(loss.until_s - start_s)
        for second in range(first, max(end, first + 1)):
            found[label][second] += loss.lost_s / max(end - first, 1)
    return found


def score_labels(true: LostByLabel, found: LostByLabel) -> LossScore:
    """The sums of each label, minute by minute."""
    score = LossScore()
    for label in {*true, *found}:
        sums = [defaultdict[int, float](float), defaultdict[int, float](float)]
        for lost, minutes in zip((true, found), sums, strict=True):
            for second, lost_s in lost.get(label, {}).items():
                minutes[second // MINUTE_S] += lost_s
        for minute in {*sums[0], *sums[1]}:
            score.add({0: sums[0][minute]}, {0: sums[1][minute]})
    return score


def _by_robot(lost: LostBySecond) -> defaultdict[int, defaultdict[int, float]]:
    joined: defaultdict[int, defaultdict[int, float]] = defaultdict(lambda: defaultdict(float))
    for (robot, _), seconds in lost.items():
        for second, lost_s in seconds.items():
            joined[robot][second] += lost_s
    return joined
