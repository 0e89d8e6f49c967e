"""How much code and text there is in a checkout. Only files that git knows count."""

import ast
import io
import subprocess
import tokenize
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("deconflict", "deconflict_client", "ingest", "metrics")
BESIDE = ("benchmarks", "examples")
OTHER_LANGUAGES = ("js", "toml", "json")
REFERENCE_PAGES = ("promises.md", "site-file.md", "api.md", "conformance.md")
LAYOUT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


class CodeSize(NamedTuple):
    """Sizes of Python code without comments, docstrings and blank lines."""

    lines: int
    tokens: int
    statements: int


def files(checkout: Path, *folders: str) -> list[Path]:
    """The files of these folders, sorted. Raises `CalledProcessError` if the checkout is none of git."""
    command = ["git", "-C", str(checkout), "ls-files", "-z", *folders]
    names = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\0")
    return [checkout / name for name in names if name]


def code_size(source: str) -> CodeSize:
    """The size of one file. A string that stands alone counts as a docstring."""
    texts, statements = set[int](), 0
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            texts.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        elif isinstance(node, ast.stmt):
            statements += 1
    lines, tokens = set[int](), 0
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in LAYOUT and token.start[0] not in texts:
            tokens += 1
            lines.update(range(token.start[0], token.end[0] + 1))
    return CodeSize(len(lines), tokens, statements)


def package_sizes(checkout: Path) -> dict[str, CodeSize]:
    """By package, and `total`."""
    sizes = {
        package: _sum(code_size(path.read_text()) for path in files(checkout, package) if path.suffix == ".py")
        for package in PACKAGES
    }
    return sizes | {"total": _sum(sizes.values())}


def _sum(sizes: Iterable[CodeSize]) -> CodeSize:
    return CodeSize(*map(sum, zip(CodeSize(0, 0, 0), *sizes, strict=True)))


def lines_in(paths: Iterable[Path]) -> int:
    return sum(path.read_bytes().count(b"\n") for path in paths)


def words_in(paths: Iterable[Path]) -> int:
    return sum(len(path.read_text().split()) for path in paths)


def other_figures(checkout: Path) -> dict[str, str | int]:
    """By name, all other sizes."""
    product = files(checkout, *PACKAGES)
    python = [path for path in product if path.suffix == ".py"]
    pages = [path for path in files(checkout, "docs") if path.suffix == ".md"]
    longest = max(python, key=lambda path: lines_in([path]))
    return {
        "lines of benchmarks and examples": lines_in(files(checkout, *BESIDE)),
        **{
            f"lines of {kind}": lines_in(path for path in product if path.suffix == f".{kind}")
            for kind in OTHER_LANGUAGES
        },
        "longest file": f"{longest.relative_to(checkout)}, {lines_in([longest])} lines",
        "words of docs": words_in(pages),
        "words of docs without reference pages": words_in(page for page in pages if page.name not in REFERENCE_PAGES),
        "Python files": len(python),
        "files": len(product),
        "folders": len({path.parent for path in product}),
    }
