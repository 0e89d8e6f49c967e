"""Figures of the code of a checkout: `python -m benchmarks.code_figures [CHECKOUT]`.

By package: lines of code, tokens and statements, without comments, docstrings and blank lines. Then other sizes. Then
the way of the status that leads to a revision, from the fleet to the engine: through how many files of the product it
goes, how often a call goes to a file that was left before, and how many maps from the UUID of a robot to a number the
engine holds. The way needs the compiled kernels of the checkout (`deconflict prepare`), or takes a minute.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from benchmarks.code_figures.code_size import other_figures, package_sizes

ROOT = Path(__file__).parent.parent.parent
STATUS_WAY = Path(__file__).parent / "status_way.py"
WAY_NAMES = {
    "files": "files that one status goes through",
    "returns": "returns to a file left before",
    "maps": "maps from UUID to slot",
}


def status_way(checkout: Path) -> dict[str, int]:
    """The figures of `status_way.py`, with the code of a checkout. Raises `CalledProcessError` if it fails."""
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    command = [sys.executable, str(STATUS_WAY)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=environment, cwd=checkout)
    figures: dict[str, int] = json.loads(done.stdout)
    return figures


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("checkout", nargs="?", type=Path, default=ROOT, help="a working tree (default: this one)")
    options.add_argument("--sizes", action="store_true", help="leave out the way of a status")
    args = options.parse_args()
    checkout = args.checkout.resolve()
    print(f"{'':<12}{'lines':>8}{'tokens':>9}{'statements':>12}")
    for package, size in package_sizes(checkout).items():
        print(f"{package:<12}{size.lines:>8}{size.tokens:>9}{size.statements:>12}")
    figures = other_figures(checkout)
    if not args.sizes:
        figures |= {WAY_NAMES[name]: figure for name, figure in status_way(checkout).items()}
    for name, figure in figures.items():
        print(f"{name:<40}{figure}")


if __name__ == "__main__":
    main()
