"""Leave aside what mypyc compiled: `python -m benchmarks.interpreted benchmarks.stages --robots 100`.

The methods of a compiled class can't be replaced by ones that tell the time, and a compiled module must give what its
source gives; both need the source in a process of its own.
"""

import runpy
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES, FileFinder, SourceFileLoader
from pathlib import Path

PRODUCT = Path(__file__).parent.parent
PACKAGES = ("ingest", "deconflict", "metrics")


def compiled() -> list[str]:
    """The modules of the product that are loaded and compiled."""
    files = {name: getattr(module, "__file__", None) or "" for name, module in sys.modules.items()}
    return [
        name
        for name, file in files.items()
        if name.split(".")[0] in PACKAGES and file.endswith(tuple(EXTENSION_SUFFIXES))
    ]


def interpret() -> None:
    """Import sources alone from now on. Raises `RuntimeError` where compiled modules are loaded already."""
    if loaded := compiled():
        raise RuntimeError(f"{', '.join(loaded)} are loaded already; interpret before anything is imported")
    sys.path_hooks.insert(0, _sources)
    sys.path_importer_cache.clear()


def _sources(folder: str) -> FileFinder:
    path = Path(folder)
    if not any(path.is_relative_to(PRODUCT / package) for package in PACKAGES):
        raise ImportError(f"{folder} is none of ours")
    return FileFinder(folder, (SourceFileLoader, SOURCE_SUFFIXES))


def run_again(module: str) -> None:
    """The same program once more, with the same arguments, interpreted."""
    sys.stdout.flush()
    subprocess.run([sys.executable, "-m", "benchmarks.interpreted", module, *sys.argv[1:]], check=True)


if __name__ == "__main__":
    interpret()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
