"""One page for a vendor: how its messages deviate from the standard, with a first example of each. It prints well."""

from collections.abc import Sequence
from html import escape

from deconflict_client.counted_nouns import count_of
from metrics.replay.conformance_counts import value_in_words
from metrics.report.html_cells import Part, document

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #17212b; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin: 1.6rem 0 .3rem; }
section { break-inside: avoid; border-top: 1px solid #d3dae1; }
pre { background: #f4f6f8; padding: .6rem; white-space: pre-wrap; overflow-wrap: anywhere; font-size: .8rem; }
.note { color: #5a6875; }
.paper { display: none; }
@page { size: A4; margin: 12mm; }
@media print {
  body { font-size: 9px; margin: 0; padding: 0; max-width: none; }
  h1 { font-size: 15px; } h2 { font-size: 10px; margin: 6px 0 1px; }
  p, pre { margin: 2px 0; } pre { padding: 3px; font-size: 7px; line-height: 1.3; max-height: 5.2em; overflow: hidden; }
  .paper { display: inline; }
}
"""


def vendor_page(vendor: Part, standards: str, log: str) -> str:
    """`vendor` is one of the vendors of the result of `conform`; `log` names what was read."""
    name, findings = vendor["vendor"], vendor["findings"]
    total = vendor["accepted"] + vendor["rejected"]
    ways = f"deviate from {standards} in {count_of(len(findings), 'way')}" if findings else f"conform to {standards}"
    accepted = f"{vendor['accepted']:,} were accepted and {vendor['rejected']:,} rejected"
    lead = f"Of {count_of(total, 'message')}, {accepted}. They {ways}."
    note = f"Read from {log}. A deviation that is not rejected was read as the sentence says."
    on_paper = "On paper long examples are cut; the page on a screen has them whole."
    parts = [
        f"<h1>{escape(name)}: conformance to {escape(standards)}</h1>",
        f"<p>{escape(lead)}</p>",
        f"<p class=note>{escape(note)} <span class=paper>{on_paper}</span></p>",
        *_not_compared(vendor.get("not_compared", ())),
        *map(_finding, findings),
    ]
    return document(name, STYLE, "\n".join(parts))


def _not_compared(robots: Sequence[Part]) -> list[str]:
    """The robots that were compared with nobody at the end."""
    rows = "".join(f"<li>{escape(robot['name'])}: {escape(robot['reason'])}</li>" for robot in robots)
    return [f"<section><h2>Compared with no other robot</h2><ul>{rows}</ul></section>"] if rows else []


def _finding(finding: Part) -> str:
    verdict = "rejected" if finding["rejects"] else "read all the same"
    example = f"<p>First example:</p><pre>{escape(finding['example'])}</pre>" if finding.get("example") else ""
    rows = "".join(f"<li>{escape(value_in_words(value))}</li>" for value in finding.get("values", ()))
    values = f"<p>Values:</p><ul>{rows}</ul>" if rows else ""
    return (
        f"<section><h2>{escape(finding['rule'])}: {count_of(finding['count'], 'time')}, {verdict}</h2>"
        f"<p>{escape(finding['meaning'])} Clause: {escape(finding['clause']) or '-'}.</p>{values}{example}</section>"
    )
