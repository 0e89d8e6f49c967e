"""Pages, tables and formatted values of the HTML reports."""

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from metrics.report.terms import TERMS

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
