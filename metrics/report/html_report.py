"""A replay's result as one HTML page. It opens offline, needs no script, and can be printed."""

from collections.abc import Iterator, Sequence
from html import escape

from deconflict.settings.site import DEFAULT, Site
from metrics.report.drawings import figures
from metrics.report.html_cells import Part, document, figure, maker, moment, number, report_style, share, table, terms
from metrics.report.opening_sections import opening
from metrics.report.place_sections import arrivals, contention, losses, places
from metrics.report.quality_sections import QUALITY, contact_alone, quality_cells, situations
from metrics.scoring.forecast_scores import BANDS

MADE_FROM = {
    "stationary": "that it stands",
    "path": "its own path",
    "velocity": "its velocity",
    "destination": "its destination",
    "order": "its order (VDA 5050)",
}
"""By the basis of a forecast."""
VIEWPORT = '<meta name="viewport" content="width=device-width, initial-scale=1">\n'


def page(result: Part, title: str, site: Site = DEFAULT, page_url: str = "") -> str:
    """The whole page for a result of `metrics/replay/replay.py`. `page_url` is the address of the operator's page."""
    body = "\n".join((*opening(result, site, page_url), *_sections(result)))
    body += f"<h2>What the columns mean</h2>{terms(body)}"
    return document(title, report_style(), f"<h1>{escape(title)}</h1>\n{body}", VIEWPORT)


def _sections(result: Part) -> Iterator[str]:
    if result["losses"]["total"]["lost_s"]:
        yield "<h2>What it cost</h2>" + losses(result["losses"], result["floors"])
    yield "<h2>Details</h2>"
    yield "<h3>Warnings by clearance</h3>" + _qualities(result["scores"])
    for score in result["scores"]:
        yield f"<h3>Probabilities at a clearance of {score['clearance_m']:g} m</h3>" + _probabilities(score)
    yield "<h3>Silent robots</h3>" + _silences(result["scores"])
    yield "<h2>Vendors</h2>" + _scorecard(result) + _trust(result["vendors"])
    yield "<h2>Forecast errors</h2>" + _errors(result["forecast_error"])
    if result["arrivals"]:
        yield "<h2>Errors of announced arrivals</h2>" + arrivals(result["arrivals"])
    if result["contention"]:
        yield "<h2>Contention, double occupancy, deadlocks and blockages</h2>" + contention(result["contention"])
    if result["situations"]["situations"]:
        yield "<h2>Situations</h2>" + situations(result["situations"])
    if result["places"]:
        yield "<h2>Forecasts for shared places</h2>" + places(result["places"])
    yield "<h2>Contact alone</h2>" + contact_alone(result["scores"])
    yield "<h2>Nearest moments</h2>" + _scenes(result["nearest"])
    yield "<h2>Deviations from the standard</h2>" + _conformance(result["conformance"])


def _qualities(scores: Sequence[Part]) -> str:
    """Every clearance in one row, and beside each what the believer of paths would have told."""
    rows = [
        [f"{score['clearance_m']:g} m{beside}", *quality_cells(score[part])]
        for score in scores
        for part, beside in (("warnings", ""), ("believer", ", if every path is believed"))
    ]
    return table(("clearance", *QUALITY), rows)


def _probabilities(score: Part) -> str:
    probability = score["warnings"]["probability"]
    if not probability["reliability"]:
        return "<p>None were published.</p>"
    caption = (
        f"{probability['samples']:,} published probabilities in ten groups of equal size; orange: those above 0.5"
        " in steps of 0.1. Perfect calibration is on the diagonal"
    )
    return figure(figures.reliability(probability["reliability"], probability["likely"]["bins"]), caption)


def _silences(scores: Sequence[Part]) -> str:
    """Advisories about robots that had become silent."""
    rows = [
        [
            f"{score['clearance_m']:g} m",
            f"{silences['raised']:,}",
            f"{silences['about_gone']:,}",
            share(silences["about_gone_share"]),
            f"{silences['silent_there']:,}",
            f"{silences['meetings']:,}",
            share(silences["told_of_share"]),
        ]
        for score in scores
        for silences in (score["silences"],)
    ]
    head = ("clearance", "advisories", "about a robot that was gone", "share", "silences of robots that were there")
    return table((*head, "encounters with these", "share with an advisory"), rows) + (
        '<p class="note">A robot counts as gone from 5 s, or three of its usual intervals if that is longer, after its'
        " last report; for good, or until it reported from another place. An encounter with a silent robot: another"
        " robot came within the clearance of its place.</p>"
    )


def _scorecard(result: Part) -> str:
    """One row for each vendor, at the first clearance, and one for all."""
    score = result["scores"][0]
    conformance = {row["vendor"]: row for row in result["conformance"]}
    ahead = {row["vendor"]: row["horizons"][2] for row in result["forecast_error"]["by_vendor"]}
    grades = {row["vendor"]: row["grade"] for row in result["vendors"]}
    rows = []
    for vendor in score["warnings"]["by_vendor"]:
        errors, counts = ahead.get(vendor["vendor"]), conformance.get(vendor["vendor"])
        deviations = sum(finding["count"] for finding in counts["findings"]) if counts else 0
        messages = counts["accepted"] + counts["rejected"] if counts else 0
        rows.append(
            [
                vendor["vendor"],
                grades.get(vendor["vendor"]) or "-",
                f"{vendor['robot_hours']:.2f}",
                *quality_cells(vendor),
                "-"
                if errors is None
                else f"{number(errors['distance_median_m'], 2)} / {number(errors['distance_p90_m'], 2)}",
                f"{messages:,}",
                f"{counts['rejected']:,}" if counts else "-",
                f"{100 * deviations / messages:.1f}" if messages else "-",
            ]
        )
    total = ["all", "-", f"{score['warnings']['robot_hours']:.2f}", *quality_cells(score["warnings"]), *4 * "-"]
    more = ("error 3 s ahead, m: median / p90", "messages", "rejected", "deviations per 100 messages")
    note = "A warning of robots of two vendors is in the rows of both, so rows add up to more than all."
    return f"<p>At a clearance of {score['clearance_m']:g} m. {note}</p>" + table(
        ("vendor", "grade", "robot-hours", *QUALITY, *more), [*rows, total]
    )


def _trust(vendors: Sequence[Part]) -> str:
    """How reliable each vendor's reports are, and what changed."""
    rows = [
        [
            score["vendor"],
            score["grade"] or "-",
            score["grade_words"],
            " / ".join(share(band["covered"]) for band in score["coverage"]) or "-",
            number(score["ece"], 3),
            f"{score['distrusted']:,}",
            f"{score['forecasts_distrusted']:,}",
        ]
        for score in vendors
    ]
    head = ("vendor", "grade", "why", "in the 50 / 80 / 90 % bands", "calibration error")
    more = ("most robots that contradicted their forecasts", "distrusted forecasts")
    flags = [
        [score["vendor"], flag["words"], moment(flag["since"]), moment(flag["until"]) if flag["until"] else "the end"]
        for score in vendors
        for flag in score["flags"]
    ]
    changed = table(("vendor", "what changed", "since", "until"), flags, text_columns=4) if flags else ""
    none = "" if flags else '<p class="note">No vendor\'s forecasts, positions or clocks changed.</p>'
    return "<h3>Reliability of reports</h3>" + table((*head, *more), rows, text_columns=3) + changed + none


def _errors(figures_by: Part) -> str:
    models = figures_by["by_model"]
    if not models:
        return "<p>No robot announced where it goes.</p>"
    legend = "".join(
        f'<li><span class="key c{number}"></span>{escape(maker(maker_row))}</li>'
        for number, maker_row in enumerate(models[: figures.COLOURS])
    )
    half = figure(figures.errors(models, "median"), "Distance from forecast to actual position: half are nearer")
    tenth = figure(figures.errors(models, "p90"), "One in ten is farther off than this")
    by_model = _error_table("vendor and model", [(maker(row), row) for row in models])
    by_basis = _error_table("made from", [(MADE_FROM[row["basis"]], row) for row in figures_by["by_basis"]])
    return f'<ul class="legend">{legend}</ul><div class="row">{half}{tenth}</div>{by_model}{by_basis}'


def _error_table(first: str, parts: Sequence[tuple[str, Part]]) -> str:
    rows = [
        [
            name,
            f"{row['horizon_s']:g}",
            f"{row['cases']:,}",
            *(
                f"{number(row[f'{kind}_median_m'], 2)} / {number(row[f'{kind}_p90_m'], 2)}"
                for kind in ("distance", "along", "across")
            ),
            " / ".join(share(row[f"covered_{band:.0%}".rstrip("%")]) for band in BANDS),
        ]
        for name, part in parts
        for row in part["horizons"]
        if row["horizon_s"] in (1.0, 3.0, 5.0, 10.0)
    ]
    head = (
        first,
        "s ahead",
        "cases",
        "error, m: median / p90",
        "along the heading",
        "across the heading",
        "in the 50 / 80 / 90 % bands",
    )
    return table(head, rows)


def _scenes(scenes: Sequence[Part]) -> str:
    drawn = [scene for scene in scenes if scene["tracks"]]
    if not drawn:
        return "<p>No two robots came near each other.</p>"
    cells = []
    for scene in drawn:
        names = " and ".join(
            f'<span class="key c{number}"></span>{escape(name)}' for number, name in enumerate(scene["names"])
        )
        depth = "touching" if scene["separation_m"] == 0 else f"{scene['separation_m']:.2f} m apart"
        floor = scene["floor_name"] or scene["floor"][:8] or "no floor"
        when = f"{moment(scene['at'])}, {scene['into_s']:.1f} s into the log"
        where = f"{floor}, x {scene['x_m']:.1f}, y {scene['y_m']:.1f}"
        lines = (names, escape(f"{depth}; {_warned(scene)}"), escape(when), escape(where))
        cells.append(f"<figure>{figures.scene(scene)}<figcaption>{'<br>'.join(lines)}</figcaption></figure>")
    return (
        f'<div class="row small">{"".join(cells)}</div>'
        '<p class="note">Six seconds before to three after. An outline each second; the nearest is filled, and'
        " a triangle shows where each robot heads. From above, x to the right, y up.</p>"
    )


def _warned(scene: Part) -> str:
    warned, until = scene["warned_s"], scene["warned_until_s"]
    if warned is None:
        return "without a warning in the 10 s before"
    over = ", still open" if until is None else f", cleared {until:.1f} s before"
    return f"warned of {warned:.1f} s ahead{over}"


def _conformance(vendors: Sequence[Part]) -> str:
    rows = [
        [
            vendor["vendor"],
            finding["rule"],
            f"{finding['count']:,}",
            "rejected" if finding["rejects"] else "read",
            finding["meaning"],
        ]
        for vendor in vendors
        for finding in vendor["findings"]
    ]
    if not rows:
        return "<p>No deviations from the standard.</p>"
    return table(("vendor", "rule", "count", "how read", "deviation, and how it is read"), rows, text_columns=5)
