"""Compares two results of `metrics/replay/replay.py`, figure by figure, with intervals.

Two results of the same log have the same encounters and the same groups of pairs, so a paired bootstrap compares each
with itself. The alerts differ, so each side draws its own.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ingest.batch import Floats
from metrics.scoring.bootstrap import DRAWS, GROUPS, SEED, Interval, middle
from metrics.scoring.summaries import brier, brier_skill, mean, median

Score = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class FigureChange:
    """One figure before and after."""

    figure: str
    before: float | None
    after: float | None
    interval: Interval
    """Interval of the difference."""

    @property
    def meaning(self) -> str:
        """The direction of the change as text. Empty if there is no interval."""
        if self.interval is None:
            return ""
        low, high = self.interval
        return "no significant change" if low <= 0 <= high else "higher" if low > 0 else "lower"


FIGURES: dict[str, tuple[str, Callable[[Floats], float | None]]] = {
    "recall": ("recalled", mean),
    "recall_any": ("recalled_any", mean),
    "lead_time_s": ("lead_time_s", median),
    "start_error_s": ("start_error_s", median),
    "precision": ("came_true", mean),
}
OF_SITUATIONS = ("came_true", "covered")
AMOUNTS = {"open_at_once": ("open_at_once", "median"), "open_s": ("open_s", "median")}
"""Figures of situations that are parts of others."""
HEAD = f"{'':<22}{'A':>9}{'B':>9}{'B - A':>9}   95 %"
BY_ENCOUNTER = ("recall", "recall_any", "lead_time_s", "start_error_s")


def page(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    """The comparison as text for a person: A before, B after, the difference and its 95 % interval."""
    return "\n".join([*_lines(a, b), ""])


def changes(a: Score, b: Score, same_log: bool) -> Iterator[FigureChange]:
    """Every figure of one clearance in two results."""
    for name, (key, figure) in FIGURES.items():
        before, after = _values(a["cases"][key]), _values(b["cases"][key])
        paired = same_log and name in BY_ENCOUNTER and len(before) == len(after)
        yield FigureChange(name, figure(before), figure(after), _difference(before, after, figure, paired))
    before, after = (np.array(score["cases"]["probabilities"], np.float64).reshape(-1, 3) for score in (a, b))
    paired = same_log and len(before) == len(after) == GROUPS
    of_a, of_b = before[:, 0] > 0, after[:, 0] > 0
    before, after = (before[of_a | of_b], after[of_a | of_b]) if paired else (before[of_a], after[of_b])
    for name, statistic in (("brier", brier), ("brier_skill", brier_skill)):
        yield FigureChange(name, a[name], b[name], _difference(before, after, statistic, paired))
    for name in ("ece", "alerts_per_robot_hour"):
        yield FigureChange(name, a[name], b[name], None)


def situation_changes(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[FigureChange]:
    """Every figure of the situations in two results."""
    for name in OF_SITUATIONS:
        before, after = _values(a["cases"][name]), _values(b["cases"][name])
        yield FigureChange(name, mean(before), mean(after), _difference(before, after, mean, paired=False))
    for name in ("per_robot_hour", "per_fresh_stop"):
        yield FigureChange(name, a[name], b[name], None)
    for name, (part, of_part) in AMOUNTS.items():
        yield FigureChange(name, a[part][of_part], b[part][of_part], None)


def _lines(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[str]:
    same_log = all(a[name] == b[name] for name in ("messages", "robots", "span_s"))
    if not same_log:
        yield "The logs differ: a difference may come from the log or from the version."
    for score_a, score_b in _matched(a["scores"], b["scores"]):
        what = " and ".join(dict.fromkeys(f"{score['clearance_m']} m" for score in (score_a, score_b)))
        yield f"clearance {what}: {score_a['foreseeable']} and {score_b['foreseeable']} foreseeable encounters"
        yield HEAD
        yield from map(_row, changes(score_a, score_b, same_log))
    of_a, of_b = a["situations"], b["situations"]
    yield f"{of_a['situations']} and {of_b['situations']} situations"
    yield HEAD
    yield from map(_row, situation_changes(of_a, of_b))


def _matched(a: Sequence[Score], b: Sequence[Score]) -> list[tuple[Score, Score]]:
    """Pairs of scores of the same clearance. If no clearance is in both, pairs in order: it may be what changed."""
    of_a = {score["clearance_m"]: score for score in a}
    found = [(of_a[score["clearance_m"]], score) for score in b if score["clearance_m"] in of_a]
    return found or list(zip(a, b, strict=False))


def _row(change: FigureChange) -> str:
    difference = None if change.before is None or change.after is None else change.after - change.before
    interval = "" if change.interval is None else f"{change.interval[0]:+.3f} to {change.interval[1]:+.3f}"
    cells = "".join(f"{'-' if value is None else f'{value:.3f}':>9}" for value in (change.before, change.after))
    step = "-" if difference is None else f"{difference:+.3f}"
    return f"{change.figure:<22}{cells}{step:>9}   {interval:<20} {change.meaning}".rstrip()


def _values(listed: str) -> Floats:
    """The values of a list in `cases`: 1 and 0 for y and n, or numbers; nan for -."""
    if " " in listed or "." in listed:
        return np.array([np.nan if value == "-" else float(value) for value in listed.split()])
    return np.array([{"y": 1.0, "n": 0.0}.get(letter, np.nan) for letter in listed])


def _difference(before: Floats, after: Floats, figure: Callable[[Floats], float | None], paired: bool) -> Interval:
    if not len(before) or not len(after):
        return None
    rng, found = np.random.default_rng(SEED), []
    for _ in range(DRAWS):
        rows = rng.integers(0, len(before), len(before))
        of_a = figure(before[rows])
        of_b = figure(after[rows if paired else rng.integers(0, len(after), len(after))])
        if of_a is not None and of_b is not None:
            found.append(of_b - of_a)
    return middle(found)
