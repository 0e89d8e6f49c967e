"""The figures of the code count code, and follow a status."""

import subprocess
from pathlib import Path

from benchmarks.code_figures.__main__ import status_way
from benchmarks.code_figures.code_size import CodeSize, code_size, other_figures, package_sizes

ROOT = Path(__file__).parent.parent.parent
SOURCE = '''"""A docstring."""

LIMIT = 3  # metres
"""What it limits."""


def twice(number: int) -> int:
    """A docstring."""
    return (
        2
        * number
    )
'''


def test_comments_docstrings_and_blank_lines_are_no_code() -> None:
    assert code_size(SOURCE) == CodeSize(lines=6, tokens=19, statements=3)


def test_files_that_git_does_not_know_do_not_count(tmp_path: Path) -> None:
    for package in ("deconflict", "ingest", "metrics", "docs"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "a.py").write_text(SOURCE)
    (tmp_path / "docs" / "api.md").write_text("four words of docs\n")
    (tmp_path / "docs" / "index.md").write_text("two words\n")
    for arguments in (["init", "--quiet"], ["add", "."]):
        subprocess.run(["git", *arguments], cwd=tmp_path, check=True)
    (tmp_path / "metrics" / "b.py").write_text(SOURCE)
    assert package_sizes(tmp_path)["total"] == CodeSize(18, 57, 9)
    figures = other_figures(tmp_path)
    assert (figures["Python files"], figures["folders"]) == (3, 3)
    assert (figures["words of docs"], figures["words of docs without reference pages"]) == (6, 2)


def test_a_status_that_leads_to_a_revision_is_followed() -> None:
    figures = status_way(ROOT)
    assert figures["files"] > 1
    assert figures["returns"] > 0
    assert figures["maps"] == 1, "one robot has one slot, which every part of the engine asks"
