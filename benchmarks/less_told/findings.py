"""Each field compared: what robots were told of with it and without it, and the classes of scenes that are worse."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.less_told.fields import Comparison, Fields, comparisons
from benchmarks.less_told.scenes import Scene
from benchmarks.less_told.scoring import SceneScore
from benchmarks.planned_floors.scoring.figure import Figure, of_cases, ratio
from benchmarks.planned_floors.scoring.markdown import aligned
from ingest.batch import Floats

LESS_TOLD = 0.02
"""Told of with a field may be so much below told of without it."""
HOLDS, MORE_VAIN = "yes", "more in vain"
OUTCOMES, TOLD, ANY, ALERTS, IN_VAIN, ROBOT_S = range(len(SceneScore._fields))
Scores = Mapping[Fields, Sequence[SceneScore]]
"""By the reported fields, the score of each scene."""


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """One comparison over many scenes."""

    comparison: Comparison
    scenes: Sequence[Scene]
    having: Floats
    """(scenes, 6) each a `SceneScore`, with the field."""
    lacking: Floats
    """(scenes, 6) without it."""

    @property
    def more_told(self) -> Figure:
        """Told of with the field, less told of without it: a share of the outcomes."""
        return self._difference(TOLD, OUTCOMES, 1)

    @property
    def more_alerts(self) -> Figure:
        """Alerts per robot-hour with the field, less those without it."""
        return self._difference(ALERTS, ROBOT_S, 3600)

    @property
    def verdict(self) -> str:
        """`yes` if the field makes it no worse; else how it does."""
        more_told, more_alerts = self.more_told["value"], self.more_alerts["value"]
        if more_told is not None and more_told < -LESS_TOLD:
            return "fewer told"
        if more_alerts is None or more_alerts <= 0:
            return HOLDS
        return (
            MORE_VAIN if self.having[:, IN_VAIN].sum() > self.lacking[:, IN_VAIN].sum() else "more alerts, none in vain"
        )

    def _difference(self, over: int, under: int, times: float) -> Figure:
        rows = np.column_stack([self.having[:, over] - self.lacking[:, over], self.having[:, under]])

        def value(draws: Floats) -> Floats:
            in_all = draws.sum(axis=1)
            return times * ratio(in_all[:, 0], in_all[:, 1])

        return of_cases(rows, value, int(self.having[:, OUTCOMES].sum()))

    def row(self) -> list[str]:
        """A row of the table."""
        named = [self.comparison.field, self.comparison.beside, f"{self.having[:, OUTCOMES].sum():.0f}"]
        shares = [_share(scores, column) for column in (TOLD, ANY) for scores in (self.having, self.lacking)]
        hourly = [
            f"{3600 * scores[:, column].sum() / scores[:, ROBOT_S].sum():.1f}"
            for column in (ALERTS, IN_VAIN)
            for scores in (self.having, self.lacking)
        ]
        more = [_signed(self.more_told, 2), _signed(self.more_alerts, 1)]
        return [*named, *shares, *hourly, *more, self.verdict]

    def worse_classes(self) -> Iterator[str]:
        """A line for each class of scenes in which fewer are told of, or more alerts are in vain."""
        for name in sorted({name for scene in self.scenes for name in scene.classes}):
            rows = np.array([name in scene.classes for scene in self.scenes])
            having, lacking = self.having[rows], self.lacking[rows]
            lost = having[:, TOLD] < lacking[:, TOLD]
            vain = having[:, IN_VAIN] > lacking[:, IN_VAIN]
            outcomes, fewer = having[:, OUTCOMES].sum(), (lacking[:, TOLD] - having[:, TOLD]).sum()
            more_vain = (having[:, IN_VAIN] - lacking[:, IN_VAIN]).sum()
            if fewer > LESS_TOLD * outcomes or more_vain > 0:
                seeds = [scene.seed for scene, kept in zip(self.scenes, rows, strict=True) if kept]
                shown = [f"told of {fewer:+.0f} fewer of {outcomes:.0f}{_seeds(seeds, lost)}"] if fewer > 0 else []
                shown += [f"{more_vain:.0f} more in vain{_seeds(seeds, vain)}"] if more_vain > 0 else []
                yield f"  - {name}: {'; '.join(shown)}"

    def document(self) -> dict[str, Any]:
        """The finding as a JSON document."""
        names = SceneScore._fields
        return {
            "field": self.comparison.field,
            "beside": self.comparison.beside,
            "with": dict(zip(names, self.having.sum(axis=0).tolist(), strict=True)),
            "without": dict(zip(names, self.lacking.sum(axis=0).tolist(), strict=True)),
            "more_told": self.more_told,
            "more_alerts_per_robot_hour": self.more_alerts,
            "verdict": self.verdict,
            "worse": list(self.worse_classes()),
        }


def findings(language: str, scenes: Sequence[Scene], scores: Scores) -> list[Finding]:
    """All comparisons of a language."""
    return [
        Finding(
            comparison,
            scenes,
            np.array(scores[comparison.having], np.float64),
            np.array(scores[comparison.lacking], np.float64),
        )
        for comparison in comparisons(language)
    ]


def report(language: str, found: Sequence[Finding]) -> str:
    """A table of all comparisons, and the classes that are worse for those that do not hold."""
    heading = ["field", "beside", "outcomes"]
    heading += [f"{figure} {how}" for figure in ("told 2 s", "any alert") for how in ("with", "without")]
    heading += [f"{figure} {how}" for figure in ("alerts/h", "in vain/h") for how in ("with", "without")]
    heading += ["more told", "more alerts/h", "no worse"]
    beyond = [finding for finding in found if finding.verdict != HOLDS]
    lines = [f"{language}: {len(found) - len(beyond)} of {len(found)} comparisons hold", ""]
    lines += [aligned([heading, *(finding.row() for finding in found)]), ""]
    for finding in beyond:
        lines.append(f"- {finding.comparison.field}, beside {finding.comparison.beside}: {finding.verdict}")
        lines += finding.worse_classes()
    return "\n".join(lines)


def _share(scores: Floats, column: int) -> str:
    outcomes = scores[:, OUTCOMES].sum()
    return f"{scores[:, column].sum() / outcomes:.2f}" if outcomes else "-"


def _signed(figure: Figure, digits: int) -> str:
    if figure["value"] is None:
        return "-"
    low, high = figure["interval"] or (figure["value"], figure["value"])
    return f"{figure['value']:+.{digits}f} ({low:+.{digits}f} to {high:+.{digits}f})"


def _seeds(seeds: Sequence[int], chosen: Floats) -> str:
    found = [str(seed) for seed, is_chosen in zip(seeds, chosen, strict=True) if is_chosen]
    return f" (seeds {', '.join(found[:12])}{' ...' if len(found) > 12 else ''})" if found else ""
