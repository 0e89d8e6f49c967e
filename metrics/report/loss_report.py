"""What the floor loses, as one HTML page that opens offline."""

from collections.abc import Sequence
from datetime import UTC, datetime
from html import escape
from typing import NamedTuple

from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.operator.suggestions.evidence import evidence_of
from deconflict.operator.suggestions.found_suggestions import OF_NO_PLACE, evidence_questions, suggestion_list
from deconflict.operator.suggestions.suggested_places import SuggestedPlaces
from deconflict.settings import site
from deconflict_client.answers.loss_models import LossKey, LossList, LossRow
from deconflict_client.answers.suggestion_models import SuggestionList
from metrics.report.html_cells import document, linked_table, report_style

WORST = 10
CSV_KEYS: tuple[LossKey, ...] = ("day", "vendor", "model", "by", "root", "kind", "floor", "place")
EXPLANATION = (
    "A robot loses time while another robot is in its way and it needs longer than by its own plan. The figures come "
    "from what the robots report. On simulated floors, where the truth is known, sums by vendor, place and day are "
    "right within a tenth; sums by kind within a fifth. People without a device, doors and faults are in no figure."
)

REFUSED = (
    "Advice that ends a standoff counts as refused if it was declined, or not begun while its robot went on standing. "
    "What robots cannot do is listed apart. The time is what others then stood, at most 60 s for each refusal. It is "
    "lost time above, too."
)
SUGGESTED = (
    "Each is derived from the losses above, and its saving is estimated from simulated floors: simulate it before you "
    "change anything."
)


class LossTables(NamedTuple):
    """The answers that a report shows."""

    before: LossList
    """The same span before; its total only."""
    pairs: LossList
    places: LossList
    kinds: LossList
    days: LossList
    vendors: LossList
    """By whose robots were in the way, or refused advice."""
    every: LossList
    """The rows of the CSV."""
    suggested: SuggestionList


def loss_tables(ledger: LossLedger, used: site.Site, from_s: float, until_s: float, ran_until_s: float) -> LossTables:
    """What robots lost in a span. The service ran until `ran_until_s` at most."""

    def ask(*keys: LossKey, limit: int = WORST) -> LossList:
        return ledger.ask(LossQuestion(from_s, until_s, keys, limit=limit))

    return LossTables(
        before=ledger.ask(LossQuestion(2 * from_s - until_s, from_s)),
        pairs=ask("vendor", "by"),
        places=ask("floor", "place"),
        kinds=ask("kind"),
        days=ask("day", limit=1000),
        vendors=ask("by", limit=1000),
        every=ask(*CSV_KEYS, limit=1_000_000),
        suggested=_suggested(ledger, used, from_s, ran_until_s),
    )


def _suggested(ledger: LossLedger, used: site.Site, from_s: float, until_s: float) -> SuggestionList:
    """What the ledger alone says: it knows nothing of forecasts and warnings."""
    answers = [ledger.ask(question) for question in evidence_questions(from_s, until_s)]
    return suggestion_list(evidence_of(answers), SuggestedPlaces.of(used), answers[0])


def loss_page(tables: LossTables, used: site.Site) -> str:
    floors = {datum.id: datum.name for datum in used.datums}
    title = f"{used.name}: what robots and people lost to each other"
    pairs = [[row["vendor"], row["by"]] for row in map(LossRow.model_dump, tables.pairs.rows)]
    places = [
        [row["place"] or "elsewhere", floors.get(row["floor"], row["floor"])]
        for row in map(LossRow.model_dump, tables.places.rows)
    ]
    kinds = [[row["kind"].replace("_", " ")] for row in map(LossRow.model_dump, tables.kinds.rows)]
    days = sorted(tables.days.rows, key=lambda row: row.model_dump()["day"])
    dates = [[f"{datetime.fromtimestamp(row.model_dump()['day'], UTC):%a %d %b} (UTC)"] for row in days]
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p class=lead>{escape(loss_sentence(tables))}</p><p>{escape(EXPLANATION)}</p>",
        _section("Worst places", ("Place", "Floor"), places, tables.places.rows, tables),
        _suggestions(tables.suggested),
        _section("Worst pairs", ("Who lost time", "Who was in the way"), pairs, tables.pairs.rows, tables),
        _section("How they were in the way", ("Kind",), kinds, tables.kinds.rows, tables),
        _section("Day by day", ("Day",), dates, days, tables),
        _refusals(tables.vendors),
    ]
    return document(title, report_style(), "\n".join(parts))


def _suggestions(suggested: SuggestionList) -> str:
    """The worst places with why and what pays, and what concerns no place; or why there is nothing."""
    found = [(place.text, place.best.check if place.best else "") for place in suggested.places]
    found += [(each.text, each.check) for each in suggested.suggestions if each.kind in OF_NO_PLACE]
    items = [
        f"<li>{escape(text)}" + (f"<br>Simulate it: <code>{escape(check)}</code>" if check else "")
        for text, check in found
    ]
    reason = f"<p>Nothing: {escape(suggested.none_because)}.</p>"
    body = f"<p>{escape(SUGGESTED)}</p><ol>{''.join(items)}</ol>" if items else reason
    return f"<h2>What to change</h2>{body}"


def _refusals(found: LossList) -> str:
    """By vendor what was refused by will, and because robots cannot, each with the time that others stood."""
    rows = sorted((row for row in found.rows if row.refusals or row.unable), key=lambda row: -row.refused_s)
    cells = [
        [escape(row.model_dump()["by"]), f"{row.refusals}", _span(row.refused_s), f"{row.unable}", _span(row.unable_s)]
        for row in rows
    ]
    heads = "Vendor", "Refused", "Others stood", "Could not", "Others stood"
    body = f"<p>{escape(REFUSED)}</p>{linked_table('refused-', heads, cells)}" if cells else "<p>Nothing.</p>"
    return f"<h2>Advice that was refused</h2>{body}"


def _section(
    title: str, heads: Sequence[str], names: Sequence[Sequence[str]], rows: Sequence[LossRow], tables: LossTables
) -> str:
    total, currency = tables.pairs.total, tables.pairs.currency
    is_priced = total.cost is not None
    cells = [
        [
            *map(escape, name),
            _span(row.lost_s),
            f"{row.lost_s / total.lost_s:.0%}",
            *([_money(row, currency)] if is_priced else []),
        ]
        for name, row in zip(names, rows, strict=True)
        if row.lost_s
    ]
    heads = (*heads, "Lost", "Share", *(["Cost"] if is_priced else []))
    return f"<h2>{escape(title)}</h2>" + (
        linked_table(f"{title.split()[1]}-", heads, cells) if cells else "<p>Nothing.</p>"
    )


def loss_sentence(tables: LossTables) -> str:
    found, before = tables.pairs, tables.before.total
    cost = "" if found.total.cost is None else f", which costs {_money(found.total, found.currency)}"
    then = f"{_span(before.lost_s)} in the same time before" if before.losses else "of the time before nothing is known"
    begin, end = (
        datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d %H:%M") for at_s in (found.from_s, found.until_s)
    )
    lost = f"From {begin} to {end} UTC robots and people lost {_span(found.total.lost_s)} to each other{cost}; {then}."
    return f"{lost} {_warning_sentence(found.total)}".rstrip()


def _warning_sentence(total: LossRow) -> str:
    if not total.losses:
        return ""
    warned = f"Of {_span(total.lost_s)} lost, {_span(total.warned_s)} were warned of before"
    if not total.advised_s:
        return f"{warned}."
    advised = f"for {_span(total.advised_s)} of them one of the two robots was advised"
    return f"{warned}; {advised}, and for {_span(total.heeded_s)} it did as advised."


def _span(lost_s: float) -> str:
    if lost_s < 120:
        return f"{lost_s:.0f} s"
    return f"{lost_s / 60:.0f} min" if lost_s < 7200 else f"{lost_s / 3600:.1f} h"


def _money(row: LossRow, currency: str) -> str:
    return "" if row.cost is None else f"{row.cost:.2f} {currency}".strip()
