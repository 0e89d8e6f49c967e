"""How good warnings and situations were, as cells of tables and sections, and warnings by contact alone."""

from collections.abc import Sequence

from deconflict_client.counted_nouns import count_of
from metrics.report.drawings import figures
from metrics.report.html_cells import Part, figure, number, percent, share, spread, sure, table
from metrics.scoring.warnings.warning_quality import WarningQuality, not_judged


def sentence(part: Part) -> str:
    """The figures of most use, as text for a person."""
    figures = [
        count_of(part["situations"], "situation"),
        f"{number(part['per_hour'])} an hour",
        f"{number(part['per_fresh_stop'], 2)} for each fresh stop",
        f"share that came true {share(part['came_true'])}, prevented {share(part['prevented'])}",
        f"{number(part['open_at_once']['median'], 0)} open at once",
        f"each for {number(part['open_s']['median'], 0)} s (medians)",
    ]
    return ", ".join(figures)


def situations(part: Part) -> str:
    """All situations, and those of each kind."""
    rows = [
        [
            row["kind"].replace("_", " "),
            f"{row['situations']:,}",
            f"{row['true']:,}",
            f"{row['in_vain']:,}",
            f"{not_judged(row):,}",
            f"{row['heeded']:,}",
            sure(row, "came_true") if "intervals" in row else share(row["came_true"]),
            spread(row["lead_time_s"]),
            number(row["open_s"]["median"]),
            number(row["open_s"]["shortest"]),
            number(row["open_s"]["longest"]),
        ]
        for row in ({**part, "kind": "all"}, *part["by_kind"])
    ]
    head = ("situation", "count", "came true", "in vain", "not judged", "prevented by advice", "share that came true")
    more = ("ahead by, s (p10 to p90)", "open for, s: median", "shortest", "longest")
    note = (
        '<p class="note">A situation came true if two of its robots met or one gave way to the other while it listed'
        " both or within 10 s after that, or if one of its other advisories came true. Ahead by: from raising to the"
        " first of these events, below 0 if all had begun.</p>"
    )
    return f"<p>{_amounts(part)}</p>" + table((*head, *more), rows) + note


def _amounts(part: Part) -> str:
    at_once, foreseen, early = part["open_at_once"], part["foreseen"], part["foreseen_3_s"]
    return (
        f"{number(part['per_hour'], 0)} an hour, {number(part['per_robot_hour'])} for each robot-hour,"
        f" {number(part['per_fresh_stop'], 2)} for each stop or swerve of a robot for another. Open at once:"
        f" {number(at_once['median'], 0)} in the median, no more than {number(at_once['p95'], 0)} for 95 % of the time,"
        f" {number(at_once['most'], 0)} at most. Of {foreseen['outcomes']:,} encounters and stops of 3 s or more that"
        f" advisories foresaw, situations showed {percent(foreseen['covered'])}; of the {early['outcomes']:,} foreseen"
        f" at least 3 s ahead, {percent(early['covered'])}."
    )


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
