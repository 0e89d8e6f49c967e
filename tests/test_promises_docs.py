"""docs/promises.md names tests that are there, and each promise has one."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
ROWS = re.findall(r"^\| ([A-Z].+?) \| (.+?) \|$", (ROOT / "docs" / "promises.md").read_text(encoding="utf-8"), re.M)


def test_every_promise_names_tests_that_exist() -> None:
    tests = {
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^(?:async )?def (test_\w+)", path.read_text(encoding="utf-8"), re.M)
    }
    assert ROWS
    missing = {promise: set(re.findall(r"`(test_\w+)`", proof)) - tests for promise, proof in ROWS}
    assert not any(missing.values()), {promise: names for promise, names in missing.items() if names}
    assert all("`test_" in proof for _, proof in ROWS)
