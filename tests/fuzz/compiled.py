"""What is left as it is while the rest is fuzzed: numba can't compile what atheris has marked."""

from pathlib import Path

PRODUCT = Path(__file__).parents[2]


def compiled_modules() -> list[str]:
    """The modules with compiled kernels, by name, and the one that compiles them."""
    every = (PRODUCT / "deconflict").rglob("*.py")
    paths = (one.relative_to(PRODUCT) for one in every if "deconflict.compiled" in one.read_text())
    return ["deconflict.compiled", *(".".join(one.with_suffix("").parts) for one in paths)]
