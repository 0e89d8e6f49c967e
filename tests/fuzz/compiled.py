"""The modules that atheris must not instrument, since numba can't compile instrumented code."""

from itertools import chain
from pathlib import Path

PRODUCT = Path(__file__).parents[2]


def compiled_modules() -> list[str]:
    """The names of the modules with kernels, and of the module that compiles them."""
    every = chain.from_iterable((PRODUCT / package).rglob("*.py") for package in ("ingest", "deconflict"))
    paths = (path.relative_to(PRODUCT) for path in every if "ingest.kernels" in path.read_text())
    return ["ingest.kernels", *(".".join(path.with_suffix("").parts) for path in paths)]
