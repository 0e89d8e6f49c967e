"""All rules of all languages, as the page docs/conformance.md."""

import sys
from collections.abc import Iterator

from ingest.languages.front_end import FrontEnd
from ingest.languages.front_ends import FRONT_ENDS


def page() -> str:
    """The text of docs/conformance.md."""
    return "\n".join([*_INTRODUCTION, *(line for each in FRONT_ENDS.values() for line in _chapters(each)), ""])


_INTRODUCTION = (
    "# Deviations from the standards",
    "",
    "All rules by which messages are checked, for each standard. A message that breaks a rule of a first table is",
    "rejected and kept in the quarantine. In all other cases the message is read as the sentence says, and the",
    "deviation is counted by vendor and rule in `deconflict_deviations_total`. *Clause* is the clause of the standard",
    "or its kind of message, or `schema` for its published JSON schema. Rules marked \\* need more than the message",
    "itself: the robot's history, the site file or the connection. Standards that share a rule share its code.",
    "",
    "Not a deviation, and therefore no rule: whole seconds in a timestamp (its resolution is estimated), a height",
    "`z` left out, an empty list, keys repeated within one object (the last one holds).",
    "",
    "Written by `python -m ingest.languages.conformance_page`.",
)


def _chapters(front_end: FrontEnd) -> Iterator[str]:
    yield from ("", f"## {front_end.standard}")
    for title, rules in front_end.chapters.items():
        yield from ("", f"### {title}", "", "| rule | seen, and how it is read | clause |", "| --- | --- | --- |")
        for rule in rules:
            mark = "" if rule.alone else " \\*"
            yield f"| `{rule.code}`{mark} | {rule.sentence} | {rule.clause} |"


if __name__ == "__main__":
    sys.stdout.write(page())
