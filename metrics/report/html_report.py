"""A replay's result as one HTML page. It opens offline, needs no script, and can be printed."""

from collections.abc import Iterator, Sequence
from html import escape

from metrics.report import figures
from metrics.report.html_cells import Part, figure, maker, moment, number, share, spread, sure, table
from metrics.report.place_sections import arrivals, contention, places
from metrics.report.situation_section import situations
from metrics.report.svg import Point
from metrics.scoring.forecast_scores import BANDS


def page(result: Part, title: str) -> str:
    """The whole page for a result of `metrics/replay/replay.py`."""
    body = "\n".join(_sections(result))
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{escape(title)}</h1>\n"
        f"{body}\n</body>\n</html>\n"
    )


def _sections(result: Part) -> Iterator[str]:
    yield (
        f"<p>{result['messages']:,} messages of {result['robots']:,} robots in {_span(result['span_s'])}, through the"
        " engine that the live service uses. Advisory, not safety rated.</p>"
    )
    if "late_messages" in result:
        yield (
            f"<p>{result['late_messages']:,} messages come after messages that were received up to"
            f" {result['late_by_s']:g} s later. They were read in the order of the log.</p>"
        )
    yield "<h2>Figures</h2>" + _figures(result["scores"])
    for score in result["scores"]:
        yield f"<h2>Clearance {score['clearance_m']:g} m</h2>" + "".join(_score(score))
    yield "<h2>Silent robots</h2>" + _silences(result["scores"])
    yield "<h2>Vendors</h2>" + _scorecard(result) + _trust(result["vendors"])
    yield "<h2>Forecast errors</h2>" + _errors(result["forecast_error"]["by_model"])
    if result["arrivals"]:
        yield "<h2>Errors of announced arrivals</h2>" + arrivals(result["arrivals"])
    if result["contention"]:
        yield "<h2>Contention, double occupancy, deadlocks and blockages</h2>" + contention(result["contention"])
    if result["situations"]["situations"]:
        yield "<h2>Situations</h2>" + situations(result["situations"])
    if result["places"]:
        yield "<h2>Forecasts for shared places</h2>" + places(result["places"])
    yield "<h2>Nearest moments</h2>" + _scenes(result["nearest"])
    yield "<h2>Deviations from the standard</h2>" + _conformance(result["conformance"])


def _figures(scores: Sequence[Part]) -> str:
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
    return table((*head, *more), rows) + (
        '<p class="note">Recall: share of foreseeable encounters with an open alert in the last 2 s before them.'
        " Precision: share of alerts followed by an encounter within 10 s. In brackets: 95 % interval.</p>"
    )


def _score(score: Part) -> Iterator[str]:
    cases = score["cases"]
    leads = [float(text) for text in cases["lead_time_s"].split() if text != "-"]
    yield '<div class="row">'
    yield figure(figures.lead_times(leads), f"Lead time of the {len(leads)} encounters with an alert")
    if score["reliability"]:
        caption = f"{score['samples']:,} published probabilities. Perfect calibration is on the diagonal"
        yield figure(figures.reliability(score["reliability"]), caption)
    for floor, alerts in sorted(_by_floor(cases).items()):
        caption = f"Where conflicts were predicted, floor {floor}: {len(alerts)} alerts"
        yield figure(figures.heat(alerts), caption)
    yield "</div>"


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


def _by_floor(cases: Part) -> dict[str, list[tuple[Point, str]]]:
    found: dict[str, list[tuple[Point, str]]] = {}
    for place, outcome in zip(cases["places"], cases["came_true"], strict=True):
        if place:
            x, y, floor = place.split(" ", 2)
            found.setdefault(floor, []).append(((float(x), float(y)), outcome))
    return found


def _scorecard(result: Part) -> str:
    """One row for each vendor, at the first clearance."""
    score = result["scores"][0]
    conformance = {row["vendor"]: row for row in result["conformance"]}
    ahead = {row["vendor"]: row["horizons"][2] for row in result["forecast_error"]["by_vendor"]}
    grades = {row["vendor"]: row["grade"] for row in result["vendors"]}
    rows = []
    for vendor in score["by_vendor"]:
        errors, counts = ahead.get(vendor["vendor"]), conformance.get(vendor["vendor"])
        deviations = sum(finding["count"] for finding in counts["findings"]) if counts else 0
        messages = counts["accepted"] + counts["rejected"] if counts else 0
        rows.append(
            [
                vendor["vendor"],
                grades.get(vendor["vendor"]) or "-",
                f"{vendor['robot_hours']:.2f}",
                f"{vendor['foreseeable']}",
                share(vendor["recall"]),
                share(vendor["precision"]),
                number(vendor["alerts_per_robot_hour"]),
                number(vendor["lead_time_s"] and vendor["lead_time_s"]["median"]),
                "-"
                if errors is None
                else f"{number(errors['distance_median_m'], 2)} / {number(errors['distance_p90_m'], 2)}",
                f"{messages:,}",
                f"{counts['rejected']:,}" if counts else "-",
                f"{100 * deviations / messages:.1f}" if messages else "-",
            ]
        )
    head = ("vendor", "grade", "robot-hours", "encounters", "recall", "precision", "alerts per robot-hour")
    more = ("lead time, s", "error 3 s ahead, m: median / p90", "messages", "rejected", "deviations per 100 messages")
    return f"<p>At a clearance of {score['clearance_m']:g} m.</p>" + table((*head, *more), rows)


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


def _errors(models: Sequence[Part]) -> str:
    if not models:
        return "<p>No robot announced where it goes.</p>"
    legend = "".join(
        f'<li><span class="key c{number}"></span>{escape(maker(maker_row))}</li>'
        for number, maker_row in enumerate(models[: figures.COLOURS])
    )
    rows = [
        [
            maker(maker_row),
            f"{row['horizon_s']:g}",
            f"{row['cases']:,}",
            *(
                f"{number(row[f'{kind}_median_m'], 2)} / {number(row[f'{kind}_p90_m'], 2)}"
                for kind in ("distance", "along", "across")
            ),
            " / ".join(share(row[f"covered_{band:.0%}".rstrip("%")]) for band in BANDS),
        ]
        for maker_row in models
        for row in maker_row["horizons"]
        if row["horizon_s"] in (1.0, 3.0, 5.0, 10.0)
    ]
    head = (
        "vendor and model",
        "s ahead",
        "cases",
        "error, m: median / p90",
        "along the heading",
        "across the heading",
        "in the 50 / 80 / 90 % bands",
    )
    chart = figure(figures.errors(models), "Distance from forecast to actual position: median (line), p90 (dashed)")
    return f'<div class="row">{chart}<ul class="legend">{legend}</ul></div>' + table(head, rows)


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
        '<p class="note">Six seconds before to three after. An outline each second; the nearest is filled.</p>'
    )


def _warned(scene: Part) -> str:
    warned, until = scene["warned_s"], scene["warned_until_s"]
    if warned is None:
        return "no advisory in the 10 s before"
    over = ", still open" if until is None else f", cleared {until:.1f} s before"
    return f"advisory {warned:.1f} s before{over}"


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
    return table(("vendor", "rule", "count", "", "deviation, and how it is read"), rows, text_columns=5)


def _span(seconds: float) -> str:
    return f"{seconds / 3600:.1f} hours" if seconds >= 7200 else f"{seconds / 60:.1f} minutes"


STYLE = """
:root{color-scheme:light dark;--back:#fff;--ink:#1a1f26;--dim:#5c6672;--rule:#dde2e8;--bar:#2f6fb3;--heat:#c2410c;
--c0:#1f6fb2;--c1:#c2410c;--c2:#2e7d32;--c3:#7b3fa0;--c4:#8a6d00;--c5:#007a87}
@media (prefers-color-scheme:dark){:root{--back:#14181d;--ink:#e6eaef;--dim:#98a3b0;--rule:#2c343d;--bar:#5aa2e6;
--heat:#ff8a4c;--c0:#6ab0f3;--c1:#ff9a62;--c2:#7fce85;--c3:#c79be6;--c4:#e3c44d;--c5:#5fd0dc}}
body{margin:2rem auto;padding:0 1.25rem;max-width:76rem;background:var(--back);color:var(--ink);
font:15px/1.5 system-ui,sans-serif}
h1{font-size:1.6rem;margin:0 0 .5rem}h2{font-size:1.15rem;margin:2.2rem 0 .6rem;padding-top:.8rem;
border-top:1px solid var(--rule)}
h3{font-size:1rem;font-weight:600;margin:1.4rem 0 .3rem}
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:14px}
th,td{padding:.3rem .8rem .3rem 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--rule)}
th{color:var(--dim);font-weight:500;vertical-align:bottom}td.n{white-space:nowrap}
.note,figcaption{color:var(--dim);font-size:13px}.row{display:flex;flex-wrap:wrap;gap:1.5rem;align-items:flex-start}
figure{margin:.5rem 0}.small figure{width:210px}
.small svg{border:1px solid var(--rule);border-radius:4px}
svg{max-width:100%;height:auto;display:block}.legend{list-style:none;padding:0;margin:1rem 0}
.key{display:inline-block;width:.7em;height:.7em;border-radius:2px;margin-right:.4em;background:currentColor}
.scale{fill:none;stroke:var(--dim);stroke-width:1.5}.grid{stroke:var(--rule)}.tick{fill:var(--dim);font-size:11px}.axis{fill:var(--dim);font-size:12px}
.ideal{stroke:var(--dim);stroke-dasharray:3 4;fill:none}.bar{fill:var(--bar)}.heat{fill:var(--heat)}
.c0{color:var(--c0)}.c1{color:var(--c1)}.c2{color:var(--c2)}.c3{color:var(--c3)}.c4{color:var(--c4)}.c5{color:var(--c5)}
.line,.dashes{fill:none;stroke:currentColor;stroke-width:2}.dashes{stroke-dasharray:6 4}.dot{fill:currentColor}
.outline{fill:none;stroke:currentColor;stroke-opacity:.35}.envelope{fill:currentColor;fill-opacity:.35;stroke:currentColor;
stroke-width:1.5}
@media print{body{margin:0;max-width:none}h2{break-after:avoid}figure{break-inside:avoid}}
"""
