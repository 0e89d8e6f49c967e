"""The modules that atheris must not instrument, since numba can't compile instrumented code."""

import re
from itertools import chain
from pathlib import Path

PRODUCT = Path(__file__).parents[2]
_COMPILED_NAME = re.compile(r"= inner\((\w+)\)")


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
    imports = [re.search(rf"^from (\S+) import .*\b{name}\b", source, re.M) for name in _COMPILED_NAME.findall(source)]
    return [found.group(1) for found in imports if found]
