"""What a replay's page tells of places that robots share: arrivals, queues, and what was said of them."""

from collections.abc import Sequence

from metrics.report.html_cells import Part, number, share, spread, sure, table


def arrivals(rows: Sequence[Part]) -> str:
    cells = [
        [
            one["vendor"],
            _ahead(one),
            f"{one['cases']:,}",
            f"{number(one['off_median_s'])} / {number(one['off_p90_s'])}",
            share(one["late"]),
            f"{one['out']:,}",
        ]
        for one in rows
    ]
    head = ("vendor", "told up to so long ahead", "words", "off, s: median / p90", "share late", "not come yet")
    return table(head, cells) + (
        '<p class="note">Of a robot that had not come when it was heard of last, only those words count whose time was'
        " over; it is late by as long as it was awaited after that, or longer.</p>"
    )


def _foretold(kinds: Sequence[Part]) -> str:
    """Which advisories came true, by how far ahead they were raised."""
    rows = [
        [one["kind"].replace("_", " "), _ahead(part), f"{part['alerts']:,}", share(part["precision"])]
        for one in kinds
        for part in one["by_ahead"]
    ]
    return table(("advisory", "raised up to so long ahead", "told", "came true"), rows) if rows else ""


def _ahead(one: Part) -> str:
    seconds = one["ahead_up_to_s"]
    return f"{seconds:g} s" if seconds < 60 else f"{seconds / 60:g} min"


def places(rows: Sequence[Part]) -> str:
    cells = [
        [
            _ahead(one),
            f"{one['said']:,}",
            share(one["came"]),
            f"{number(one['off_median_s'])} / {number(one['off_p90_s'])}",
            share(one["late"]),
            f"{one['entries']:,}",
            share(one["foretold"]),
            f"{one['full_said']:,}",
            share(one["full_precision"]),
            f"{one['full_happened']:,}",
            share(one["full_recall"]),
        ]
        for one in rows
    ]
    needed = [
        [
            _ahead(one),
            f"{one['need_said']:,}",
            share(one["need_likely"]),
            share(one["need_came"]),
            number(one["need_brier"], 3),
        ]
        for one in rows
        if one["need_said"]
    ]
    comes = ("said up to so long ahead", "to come", "came", "off, s: median / p90", "late", "came at all", "foretold")
    full = ("said to be full", "was", "was full", "foretold")
    needs = ("a charger needed within", "said", "how likely, mean", "came to one", "Brier score")
    note = (
        '<p class="note">Said every ten seconds of each resource: who has it from when on, and whether it is full so'
        " long after. A robot came at all where it was heard for so long before.</p>"
    )
    return table((*comes, *full), cells) + note + (table(needs, needed) if needed else "")


def contention(kinds: Sequence[Part]) -> str:
    rows = [
        [
            one["kind"].replace("_", " "),
            f"{one['alerts']:,}",
            f"{one['censored']:,}",
            sure(one, "precision"),
            spread(one["lead_time_s"]),
            number(one["wait_error_s"]),
            "-" if one["happened"] is None else f"{one['happened']:,}",
            sure(one, "recall"),
            share(one["recall_any"]),
        ]
        for one in kinds
    ]
    head = ("advisory", "told", "can't be told", "came true", "lead time, s (p10 to p90)", "wait off by, s")
    more = ("happened", "told before it began", "or while it lasted")
    note = (
        '<p class="note">A queue came true where one of its robots stood for 5 s while the place was full; a crowd'
        " where more were inside than it takes; a deadlock where all of its ring stood for 5 s; a blockage where one"
        " stood behind the blocker.</p>"
    )
    return table((*head, *more), rows) + note + _foretold(kinds)
