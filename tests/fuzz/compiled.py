"""The modules that atheris must not instrument, since numba can't compile instrumented code."""

import ast
import re
from itertools import chain
from pathlib import Path

PRODUCT = Path(__file__).parents[2]
_COMPILED_NAME = re.compile(r"\binner\((\w+)\)")


def compiled_modules() -> list[str]:
    """The modules with kernels, those of the functions that they compile, and the module that compiles them."""
    modules = ["ingest.kernels"]
    for path in chain.from_iterable((PRODUCT / package).rglob("*.py") for package in ("ingest", "deconflict")):
        source = path.read_text()
        if "ingest.kernels" in source:
            modules += [".".join(path.relative_to(PRODUCT).with_suffix("").parts), *_homes_of_helpers(source)]
    return modules


def _homes_of_helpers(source: str) -> list[str]:
    """The modules from which a file imports functions that it compiles."""
    names = set(_COMPILED_NAME.findall(source))
    imports = [node for node in ast.parse(source).body if isinstance(node, ast.ImportFrom)]
    return [node.module or "" for node in imports if not names.isdisjoint(alias.name for alias in node.names)]
