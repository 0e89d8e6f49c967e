"""What is left as it is while the rest is fuzzed: numba can't compile what atheris has marked."""

from itertools import chain
from pathlib import Path

PRODUCT = Path(__file__).parents[2]


def compiled_modules() -> list[str]:
    """The modules with compiled kernels, by name, and the one that compiles them."""
    every = chain.from_iterable((PRODUCT / package).rglob("*.py") for package in ("ingest", "deconflict"))
    paths = (one.relative_to(PRODUCT) for one in every if "ingest.kernels" in one.read_text())
    return ["ingest.kernels", *(".".join(one.with_suffix("").parts) for one in paths)]
