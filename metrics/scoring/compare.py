"""Compares two results of `metrics/replay/replay.py`, figure by figure, with intervals, and says what is better.

First come the figures that a report begins with, in its words (`WarningQuality`), then those of contact alone.

Two results of the same log have the same encounters and the same groups of pairs, so a paired bootstrap compares each
with itself. The alerts differ, so each side draws its own.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deconflict_client.counted_nouns import count_of
from ingest.batch import Floats
from metrics.scoring.bootstrap import DRAWS, GROUPS, SEED, Interval, middle
from metrics.scoring.summaries import brier, brier_skill, mean, median
from metrics.scoring.warnings.warning_quality import WarningQuality

Score = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class FigureChange:
    """One figure before and after."""

    figure: str
    before: float | None
    after: float | None
    interval: Interval
    """Interval of the difference."""
    good: int = 0
    """1 if more is better, -1 if less is, 0 if that can't be said."""

    @property
    def meaning(self) -> str:
        """What the change means, as text. Empty if there is no interval."""
        if self.interval is None:
            return ""
        low, high = self.interval
        if low <= 0 <= high:
            return "no significant change"
        if not self.good:
            return "higher" if low > 0 else "lower"
        return "better" if (low > 0) == (self.good > 0) else "worse"


HEADLINE: dict[str, tuple[str, Callable[[Floats], float | None]]] = {
    "warned of": ("warned_of", mean),
    "warned of, 2 s ahead": ("warned_of_2_s", mean),
    "ahead by, s": ("ahead_by_s", median),
    "came true": ("came_true", mean),
}
"""By the word of a report, the list of cases of `warnings`, and the figure."""
FIGURES: dict[str, tuple[str, Callable[[Floats], float | None]]] = {
    "recall": ("recalled", mean),
    "recall_any": ("recalled_any", mean),
    "lead_time_s": ("lead_time_s", median),
    "start_error_s": ("start_error_s", median),
    "precision": ("came_true", mean),
}
WORSE_IF_MORE = {"start_error_s", "brier", "ece"}
OF_SITUATIONS = {"came_true": "came true", "covered": "covered"}
"""By the list of cases, the word of a report."""
AMOUNTS = {"open_at_once": ("open_at_once", "median"), "open_s": ("open_s", "median")}
"""Figures of situations that are parts of others."""
CONTACT_ALONE = "Contact alone: robots that stop or swerve in time make a warning count as false. For older results."
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
        difference = _difference(before, after, figure, paired)
        yield FigureChange(name, figure(before), figure(after), difference, _good(name))
    before, after = (np.array(score["cases"]["probabilities"], np.float64).reshape(-1, 3) for score in (a, b))
    paired = same_log and len(before) == len(after) == GROUPS
    of_a, of_b = before[:, 0] > 0, after[:, 0] > 0
    before, after = (before[of_a | of_b], after[of_a | of_b]) if paired else (before[of_a], after[of_b])
    for name, statistic in (("brier", brier), ("brier_skill", brier_skill)):
        difference = _difference(before, after, statistic, paired)
        yield FigureChange(name, a[name], b[name], difference, _good(name))
    yield FigureChange("ece", a["ece"], b["ece"], None, _good("ece"))


def headline_changes(a: Score, b: Score, same_log: bool) -> Iterator[FigureChange]:
    """The figures of quality in `warnings` of two results, in the words of a report."""
    of_a, of_b = WarningQuality.of(a), WarningQuality.of(b)
    for name, (key, figure) in HEADLINE.items():
        before, after = _values(a["cases"][key]), _values(b["cases"][key])
        paired = same_log and key != "came_true" and len(before) == len(after)
        yield FigureChange(name, figure(before), figure(after), _difference(before, after, figure, paired), 1)
    shares = (_share(of_a.not_judged, of_a.warnings), _share(of_b.not_judged, of_b.warnings))
    yield FigureChange("not judged", *shares, None)
    rates = of_a.warnings_per_robot_hour, of_b.warnings_per_robot_hour
    yield FigureChange("per robot-hour", *rates, None)


def situation_changes(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[FigureChange]:
    """Every figure of the situations in two results."""
    for name, label in OF_SITUATIONS.items():
        before, after = _values(a["cases"][name]), _values(b["cases"][name])
        yield FigureChange(label, mean(before), mean(after), _difference(before, after, mean, paired=False), 1)
    for name in ("per_robot_hour", "per_fresh_stop"):
        yield FigureChange(name, a[name], b[name], None)
    for name, (part, of_part) in AMOUNTS.items():
        yield FigureChange(name, a[part][of_part], b[part][of_part], None)


def _lines(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[str]:
    same_log = all(a[name] == b[name] for name in ("messages", "robots", "span_s"))
    if not same_log:
        yield "The logs differ: a difference may come from the log or from the version."
    matched = _matched(a["scores"], b["scores"])
    for score_a, score_b in matched:
        of_a, of_b = score_a["warnings"], score_b["warnings"]
        events = WarningQuality.of(of_a).events, WarningQuality.of(of_b).events
        times = f"{events[0]} and {count_of(events[1], 'time')}"
        yield f"clearance {_clearances(score_a, score_b)}: {times} in each other's way"
        yield HEAD
        yield from map(_row, headline_changes(of_a, of_b, same_log))
    of_a, of_b = a["situations"], b["situations"]
    yield f"{of_a['situations']} and {count_of(of_b['situations'], 'situation')}"
    yield HEAD
    yield from map(_row, situation_changes(of_a, of_b))
    yield CONTACT_ALONE
    for score_a, score_b in matched:
        counts = f"{score_a['foreseeable']} and {score_b['foreseeable']} foreseeable encounters"
        yield f"clearance {_clearances(score_a, score_b)}: {counts}"
        yield HEAD
        yield from map(_row, changes(score_a, score_b, same_log))


def _clearances(a: Score, b: Score) -> str:
    return " and ".join(dict.fromkeys(f"{score['clearance_m']} m" for score in (a, b)))


def _good(name: str) -> int:
    return -1 if name in WORSE_IF_MORE else 1


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


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
