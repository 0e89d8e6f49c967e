"""The situations of a replay in one sentence, and as a section of its report."""

from deconflict_client.counted_nouns import count_of
from metrics.report.html_cells import Part, number, percent, share, spread, sure, table
from metrics.scoring.warnings.warning_quality import not_judged


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
