"""How good warnings were, as cells of tables, and the same by contact alone, as a section that says what it is."""

from collections.abc import Sequence

from metrics.report.drawings import figures
from metrics.report.html_cells import Part, figure, number, percent, share, spread, sure, table
from metrics.scoring.warnings.warning_quality import WarningQuality

QUALITY = (
    "events",
    "warned of",
    "ahead by, s",
    "warnings",
    "came true",
    "in vain",
    "not judged",
    "share that came true",
    "warnings per robot-hour",
)
"""Titles of the cells of `quality_cells`."""


def quality_cells(part: Part) -> list[str]:
    """What came of the warnings of one row: of a log, a vendor or two vendors."""
    quality = WarningQuality.of(part)
    return [
        f"{quality.events:,}",
        f"{quality.warned_of:,} ({percent(quality.share_warned_of)})",
        number(quality.ahead_by_s["median"] if quality.ahead_by_s else None),
        f"{quality.warnings:,}",
        f"{quality.came_true:,}",
        f"{quality.in_vain:,}",
        f"{quality.not_judged:,}",
        percent(quality.share_came_true),
        number(quality.warnings_per_robot_hour),
    ]


def contact_alone(scores: Sequence[Part]) -> str:
    """The figures of encounters alone, as older releases had them, with their own words."""
    rows = [
        [
            f"{score['clearance_m']:g} m",
            f"{score['foreseeable']}",
            sure(score, "recall"),
            share(score["recall_any"]),
            f"{score['alerts']}",
            f"{score['censored'] + score['heeded']}",
            sure(score, "precision"),
            spread(score["lead_time_s"]),
            number(score["start_error_s"]),
            number(score["ece"], 3),
            number(score["brier_skill"], 2),
        ]
        for score in scores
    ]
    head = ("clearance", "encounters foreseeable", "recall", "at any time", "alerts", "outcome unknown", "precision")
    more = ("lead time, s (p10 to p90)", "start error, s", "calibration error", "Brier skill")
    return _note() + table((*head, *more), rows) + "".join(map(_leads, scores))


def _note() -> str:
    return (
        '<p class="note">Not how good warnings were, but how they compare with older results: only robots that came'
        " within the clearance count, and one that stops or swerves in time makes its warning count as false. Recall:"
        " share of foreseeable encounters with an open alert in the last 2 s before them. Precision: share of alerts"
        " followed by an encounter within 10 s. In brackets: 95 % interval.</p>"
    )


def _leads(score: Part) -> str:
    leads = [float(text) for text in score["cases"]["lead_time_s"].split() if text != "-"]
    caption = f"Contact alone, {score['clearance_m']:g} m: lead time of the {len(leads)} encounters with an alert"
    return figure(figures.lead_times(leads), caption)
