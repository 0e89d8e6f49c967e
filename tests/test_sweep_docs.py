"""The examples of docs/sweep.md run as shown."""

import re
from doctest import DocTestParser, DocTestRunner
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "sweep.md").read_text(), re.S)


def failures(block: str, names: dict[str, Any]) -> int:
    """How many lines of a block answer otherwise than shown; adds what it defines to `names`."""
    test = DocTestParser().get_doctest(block, names, "example", "example", 0)
    assert test.examples
    result = DocTestRunner().run(test, clear_globs=False)
    names |= test.globs
    return result.failed


def test_the_examples_run_as_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    *examples, picture = BLOCKS
    names: dict[str, Any] = {}
    assert [failures(example, names) for example in examples] == [0] * len(examples)
    pytest.importorskip("matplotlib")
    assert failures(picture, names) == 0
    assert (tmp_path / "sweep.png").stat().st_size > 10_000
