"""Pages, tables and formatted values of the HTML reports, and what their columns mean: titles show it on hover, and the
end of a report lists it."""

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

TERMS = {
    "Brier score": "mean squared error of the probability; 0 is perfect",
    "Brier skill": "1 is perfect, 0 is as good as always giving the average, below 0 is worse",
    "a charger needed within": "how far ahead the service says that a robot will need a charger",
    "about a robot that was gone": "advisories about robots that had left the floor by then",
    "across the heading": "how far robots were to the side of where they were expected, m: median / p90",
    "advisories": "advisories that were raised",
    "advisory": "kind of advisory",
    "ahead by, s": "from raising the warning to the event that was warned of, median",
    "ahead by, s (p10 to p90)": "from raising it to its first event: median, and the range without the outer tenths",
    "alerts": "contact alone: warnings of which the outcome is known",
    "all arrivals": "arrivals that really happened",
    "all full times": "times at which the place really was full",
    "along the heading": "how far robots were ahead of or behind where they were expected, m: median / p90",
    "announced up to": "how long before the arrival it was announced, at most",
    "announcements": "announced arrivals of which the outcome is known",
    "arrived": "share of the predicted arrivals that happened",
    "at any time": "recall of an alert open at any time in the last 10 s",
    "calibration error": "mean distance of published probabilities from the shares that came true; 0 is perfect",
    "came to one": "share of the robots that went to a charger in that time",
    "came true": "with an event within 10 s after; each event makes one warning true",
    "cases": "forecasts of which the robot's later position is known",
    "clearance": "robots nearer than this are in conflict",
    "cost": "by the costs of the site file; - without them",
    "count": "how often it occurred",
    "deviation, and how it is read": "what differs from the standard, and what the service makes of it",
    "deviations per 100 messages": "deviations from the standard that the service found and interpreted",
    "distrusted forecasts": "forecasts that the service did not rely on, because the robot contradicted them",
    "encounters": "times at which two robots were within the clearance",
    "encounters foreseeable": "encounters of which both robots were on the floor 2 s before",
    "encounters with these": "times at which another robot came within the clearance of a silent one",
    "error 3 s ahead, m: median / p90": "distance from where a robot was expected 3 s ahead to where it was",
    "error of the wait, s": "median error of the predicted longest wait",
    "error, m: median / p90": "distance from where a robot was expected to where it was",
    "error, s: median / p90": "time between the announced or predicted arrival and the real one",
    "events": "times at which two robots got in each other's way: a stop or swerve of one, or an encounter",
    "floor": "floor of the place",
    "grade": "reliability of the vendor's reports, A (best) to E",
    "how read": "whether the message is rejected, or read all the same",
    "in the 50 / 80 / 90 % bands": "shares of forecasts that were off by no more than the service had learned",
    "in vain": "those after which nothing happened",
    "late": "share of arrivals that came later than predicted",
    "lead time, s (p10 to p90)": "contact alone: from the alert to the encounter: median, and p10 to p90",
    "longest": "the longest time that one was open, s",
    "lost": "time that robots and people lost to each other",
    "lost to": "vendor whose robots or people were in the way",
    "made from": "what forecasts are made from",
    "mean probability": "mean of the published probabilities",
    "messages": "messages of the vendor's robots",
    "most robots that contradicted their forecasts": "largest number of its robots at one time",
    "not arrived": "announcements of robots that never arrived",
    "not judged": "those of which nobody can say: a robot left, followed advice, or the event had begun",
    "of all": "share of all that was lost",
    "open for, s": "how long the warning was open",
    "open for, s: median": "how long they were open",
    "or during it": "share of the events with an advisory before or during it",
    "outcome unknown": "contact alone: a robot left before the outcome, or waited as advised",
    "place": "floor and position, metres in the floor's frame",
    "precision": "contact alone: share of alerts followed by an encounter within 10 s",
    "predicted": "how often it was predicted; beside real events, the share of them that was predicted",
    "predicted full": "how often a place was predicted to be full",
    "predicted in, s": "from raising it to the predicted beginning, by its last revision before that",
    "predicted up to": "how far ahead it was predicted, at most",
    "prevented by advice": "of those not judged, those after which nothing happened because a robot did as advised",
    "raised up to": "how long before the event the advisory was raised, at most",
    "recall": "contact alone: share of encounters with an alert open in the last 2 s before them",
    "rejected": "messages that could not be read",
    "robot-hours": "time that the vendor's robots were on the floor",
    "robots": "the two robots",
    "rule": "code of the rule of the standard, as in docs/conformance.md",
    "s ahead": "how far ahead the forecast looks",
    "share": "part of all",
    "share late": "share of robots that arrived later than they announced",
    "share that came true": "of those that are judged: came true or in vain",
    "share with an advisory": "of these encounters",
    "shortest": "the shortest time that one was open, s",
    "silences of robots that were there": "times at which a robot on the floor sent nothing for long",
    "since": "when it began",
    "situation": "kind of situation",
    "start error, s": "median error of the predicted start of the encounter",
    "stops": "times at which a robot braked, stopped or swerved for another",
    "times it happened": "whether or not there was an advisory",
    "until": "when it ended",
    "vendor": "as named in the site file, or by its robots",
    "vendor and model": "as its robots identify themselves",
    "vendors": "the vendors of the two robots",
    "warned of": "events with a warning in the 10 s before",
    "warnings": "advisories on conflicts of two robots",
    "warnings per robot-hour": "all warnings, divided by the time for which the robots were on the floor",
    "was full": "share of these predictions that came true",
    "what": "a stop of one robot for the other, or an encounter; of a warning, how the two would meet",
    "what changed": "which of the vendor's values differs from what it was",
    "when": "time in UTC, and seconds from the beginning of the log",
    "where": "place, or elsewhere",
    "whose robots": "vendor whose robots or people lost the time",
    "why": "the grade in words",
    "with an advisory before": "share of the events, and its 95 % interval",
}


Part = Mapping[str, Any]


def document(title: str, style: str, body: str, meta: str = "") -> str:
    """A page that opens offline. `meta` are further lines of its head."""
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n{meta}<title>{escape(title)}</title>\n'
        f"<style>{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def report_style() -> str:
    return files("metrics.report").joinpath("report.css").read_text(encoding="utf-8")


def table(head: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int = 1) -> str:
    """A table with escaped cells. The first `text_columns` columns hold text, the others numbers. Each title is one of
    `TERMS`."""
    top = "".join(f'<th title="{escape(TERMS[title])}">{escape(title)}</th>' for title in head)
    body = "".join(
        "<tr>"
        + "".join(f"<td{'' if n < text_columns else ' class=n'}>{escape(cell)}</td>" for n, cell in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def linked_table(prefix: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of cells that are HTML. Its rows are named by the prefix and their number."""
    top = "".join(f'<th title="{escape(TERMS.get(title, ""))}">{escape(title)}</th>' for title in head)
    body = "".join(
        f'<tr id="{prefix}{number}">{"".join(f"<td>{cell}</td>" for cell in row)}</tr>'
        for number, row in enumerate(rows, 1)
    )
    return f'<div class="wide"><table class="cases"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def terms(body: str) -> str:
    """The meaning of every column of the tables in a page."""
    used = [term for term in TERMS if f">{escape(term)}</th>" in body]
    rows = "".join(f"<dt>{escape(term)}</dt><dd>{escape(TERMS[term])}</dd>" for term in used)
    return f'<dl class="terms">{rows}</dl>'


def figure(drawing: str, caption: str) -> str:
    return f"<figure>{drawing}<figcaption>{escape(caption)}</figcaption></figure>"


def maker(row: Part) -> str:
    return f"{row['vendor']} {row['model']}".strip()


def sure(score: Part, name: str) -> str:
    interval = score["intervals"][name]
    return share(score[name]) + (f" ({interval[0]:.2f} to {interval[1]:.2f})" if interval else "")


def share(value: float | None) -> str:
    return number(value, 2)


def percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.0f} %"


def number(value: float | None, digits: int = 1) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def spread(value: Part | None) -> str:
    return "-" if value is None else f"{value['median']:.1f} ({value['p10']:.1f} to {value['p90']:.1f})"


def moment(stamp: str) -> str:
    """A timestamp as text for a person, UTC."""
    return f"{stamp[:10]} {stamp[11:19]} UTC"
