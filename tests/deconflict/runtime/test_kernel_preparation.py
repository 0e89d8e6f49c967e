"""Kernels are compiled by other processes, and found on disk by the one that needs them."""

import subprocess
import sys
from pathlib import Path

from deconflict.runtime.kernel_preparation import ALL_PACKAGES

ROOT = Path(__file__).parents[3]
KERNELS = """
import numba
from ingest.kernels import kernel

@kernel(numba.float64(numba.float64))
def half(x):
    return x / 2

@kernel(numba.float64(numba.float64))
def third(x):
    return x / 3
"""
IMPORTING = KERNELS.replace("half", "quarter").replace("third", "fifth") + "\nfrom made.halves import half\n"
PREPARES = """
from functools import partial
from deconflict.runtime.kernel_preparation import compile_kernels

if __name__ == "__main__":
    reports = []
    from ingest.kernels import before_compiling

    with before_compiling(partial(compile_kernels, ("made",), lambda *counts: reports.append(counts))):
        from made import quarters, halves
    kernels = quarters.quarter, quarters.fifth, halves.half, halves.third
    print(reports, [len(kernel.stats.cache_misses) for kernel in kernels])
"""


def run(folder: Path) -> str:
    environment = {"HOME": str(folder), "PYTHONPATH": f"{ROOT}:{folder}", "NUMBA_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, str(folder / "prepares.py")]
    return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.strip()


def test_the_first_compilation_has_all_kernels_compiled_and_counts_them(tmp_path: Path) -> None:
    made = tmp_path / "made"
    made.mkdir()
    for name, text in (("__init__.py", ""), ("halves.py", KERNELS), ("quarters.py", IMPORTING)):
        (made / name).write_text(text)
    (tmp_path / "prepares.py").write_text(PREPARES)
    missed = 1  # the kernel whose absence was noticed is compiled here as well
    assert run(tmp_path) in (
        f"[(0, 4), (2, 4), (4, 4)] [0, 0, {missed}, 0]",
        f"[(0, 4), (2, 4), (4, 4)] [{missed}, 0, 0, 0]",
    )
    assert run(tmp_path) == "[] [0, 0, 0, 0]", "nothing is prepared where everything is on disk"


def test_every_kernel_of_the_product_is_in_a_package_that_prepare_compiles() -> None:
    packages = {path.parent for path in ROOT.glob("*/__init__.py")} - {ROOT / "tests"}
    with_kernels = {
        package.name for package in packages for path in package.rglob("*.py") if "\n@kernel(" in path.read_text()
    }
    assert with_kernels == set(ALL_PACKAGES)
