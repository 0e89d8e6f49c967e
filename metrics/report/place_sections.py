"""Sections of a replay's report about places: what was lost there, arrivals, contention, and forecasts."""

from collections.abc import Mapping, Sequence

from deconflict.operator.suggestions.suggestion import minutes
from metrics.report.html_cells import Part, number, percent, share, spread, sure, table
from metrics.report.replay_summary import money

MOST = 10
"""Rows of a table of losses."""


def arrivals(rows: Sequence[Part]) -> str:
    cells = [
        [
            row["vendor"],
            _ahead(row),
            f"{row['cases']:,}",
            f"{number(row['off_median_s'])} / {number(row['off_p90_s'])}",
            share(row["late"]),
            f"{row['out']:,}",
        ]
        for row in rows
    ]
    head = ("vendor", "announced up to", "announcements", "error, s: median / p90", "share late", "not arrived")
    return table(head, cells) + (
        '<p class="note">If a robot never arrived, only announcements count whose time passed before its last report.'
        " It is late by at least the time between the two.</p>"
    )


def losses(part: Part, floors: Mapping[str, str]) -> str:
    """What was lost in each place, and by each vendor to another, the most first."""
    where = [
        [row["place"] or "elsewhere", floors.get(row["floor"], "-"), *_lost(row, part)]
        for row in part["by_place"][:MOST]
    ]
    whose = [[row["vendor"], row["by"], *_lost(row, part)] for row in part["by_vendors"][:MOST]]
    note = (
        '<p class="note">As in the ledger of the service: <code>deconflict losses</code> has it by day, with what to'
        " change; what people on foot lose counts, too.</p>"
    )
    places_table = table(("where", "floor", "lost", "of all", "cost"), where, 2)
    return places_table + table(("whose robots", "lost to", "lost", "of all", "cost"), whose, 2) + note


def _lost(row: Part, part: Part) -> tuple[str, str, str]:
    return minutes(row["lost_s"]), percent(row["lost_s"] / part["total"]["lost_s"]), money(row, part["currency"])


def _by_ahead(kinds: Sequence[Part]) -> str:
    """The share of advisories that came true, by how far ahead they were raised."""
    rows = [
        [kind_row["kind"].replace("_", " "), _ahead(part), f"{part['alerts']:,}", share(part["precision"])]
        for kind_row in kinds
        for part in kind_row["by_ahead"]
    ]
    return table(("advisory", "raised up to", "advisories", "share that came true"), rows) if rows else ""


def _ahead(row: Part) -> str:
    seconds = row["ahead_up_to_s"]
    return f"{seconds:g} s" if seconds < 60 else f"{seconds / 60:g} min"


def places(rows: Sequence[Part]) -> str:
    cells = [
        [
            _ahead(row),
            f"{row['said']:,}",
            share(row["came"]),
            f"{number(row['off_median_s'])} / {number(row['off_p90_s'])}",
            share(row["late"]),
            f"{row['entries']:,}",
            share(row["foretold"]),
            f"{row['full_said']:,}",
            share(row["full_precision"]),
            f"{row['full_happened']:,}",
            share(row["full_recall"]),
        ]
        for row in rows
    ]
    needed = [
        [
            _ahead(row),
            f"{row['need_said']:,}",
            share(row["need_likely"]),
            share(row["need_came"]),
            number(row["need_brier"], 3),
        ]
        for row in rows
        if row["need_said"]
    ]
    comes = ("predicted up to", "predicted", "arrived", "error, s: median / p90", "late", "all arrivals", "predicted")
    full = ("predicted full", "was full", "all full times", "predicted")
    needs = ("a charger needed within", "predicted", "mean probability", "came to one", "Brier score")
    note = (
        '<p class="note">Every ten seconds the service predicts for each resource who will occupy it from when, and'
        " whether it will be full. An arrival counts only if the robot was known for that long before.</p>"
    )
    return table((*comes, *full), cells) + note + (table(needs, needed) if needed else "")


def contention(kinds: Sequence[Part]) -> str:
    rows = [
        [
            row["kind"].replace("_", " "),
            f"{row['alerts']:,}",
            f"{row['censored']:,}",
            sure(row, "precision"),
            spread(row["lead_time_s"]),
            number(row["wait_error_s"]),
            "-" if row["happened"] is None else f"{row['happened']:,}",
            sure(row, "recall"),
            share(row["recall_any"]),
        ]
        for row in kinds
    ]
    head = ("advisory", "count", "not judged", "share that came true", "ahead by, s (p10 to p90)")
    more = ("error of the wait, s", "times it happened", "with an advisory before", "or during it")
    note = (
        '<p class="note">A contention came true if one of its robots stood for 5 s while the place was full; a double'
        " occupancy if more robots were inside than the capacity; a deadlock if all robots of its ring stood for 5 s;"
        " a blockage if a robot stood behind the blocker.</p>"
    )
    return table((*head, *more), rows) + note + _by_ahead(kinds)
