"""A count has its noun from one function: "1 warning", "2 warnings", "1,200 boxes"."""

import re
from pathlib import Path

import pytest

from deconflict_client.counted_nouns import count_of

ROOT = Path(__file__).parent.parent
NOUNS = (
    "advisories|boxes|changes|conflicts|errors|events|files|floors|lines|losses|messages|orders|others|pairs|people|places|"
    "problems|requests|revisions|robots|rows|senders|situations|statuses|stops|times|values|vendors|warnings"
)
AFTER_A_COUNT = re.compile(r"\{[^{}]+\} (?:more )?(?:" + NOUNS + r")\b")
SEVERAL = {
    "{count} robots": "a crowd has more",
    "{inside} robots are": "more than a place takes",
    "{len(names) - 3} others": "of five at least",
    "{spots} places": "at one it is not said",
    "{ended} lines and": "the number that a broken file has",
    "{MOST_": "a limit",
    "{len(self._pending)} revisions wait": "thousands",
    "{robots} robots do not fit": "more than there are bays",
    "{count:,} times": "one is said as once",
    "{len(aisles)} floors": "one is no fault",
    "{factor:g} times": "100 or 1000",
    "{self.factor:g} times": "100 or 1000",
    "{places} places with {fewest}": "a comment in a file",
    "{len(members)} stops": "`fewest` at least",
    "{robot.rejected} messages": "several at least",
    "{off_m:z.3f} m": "names",
    "{vendor} people": "a name",
    "${matching.length} robots have": "one that was found is shown",
}
"""What is no count, or always several."""


@pytest.mark.parametrize(("count", "text"), [(0, "0 boxes"), (1, "1 box"), (2, "2 boxes"), (1200, "1,200 boxes")])
def test_one_is_singular(count: int, text: str) -> None:
    assert count_of(count, "box", "boxes") == text
    assert count_of(count, "robot") == text.replace("boxes", "robots").replace("box", "robot")


def test_no_sentence_puts_a_noun_of_several_after_a_count_by_itself() -> None:
    files = [
        path for home in ("deconflict", "deconflict_client", "ingest", "metrics") for path in (ROOT / home).rglob("*.*")
    ]
    found = []
    for path in files:
        if path.suffix not in (".py", ".js"):
            continue
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if AFTER_A_COUNT.search(line) and not any(part in line for part in SEVERAL):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
    assert found == []
