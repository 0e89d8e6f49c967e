"""Imports run one way: ingest <- deconflict <- metrics; only the composition root may look right."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FORBIDDEN = {"ingest": {"deconflict", "metrics"}, "deconflict": {"metrics"}, "metrics": set[str]()}
COMPOSITION_ROOT = Path("deconflict/__main__.py")
SIMULATED_FLOORS = ROOT / "benchmarks/planned_floors"
FLOOR_FOLDERS = {
    "truth": set[str](),
    "logs": {"truth"},
    "floors": {"truth", "logs"},
    "scoring": {"truth", "logs"},
    "comparison": {"truth", "logs", "floors", "scoring"},
}
"""By folder of the simulated floors, what it may import from."""
CLUSTER_BUS = "deconflict/cluster/nats/bus.py"


def imported_packages(source: str) -> set[str]:
    return {name.split(".")[0] for name in imported_modules(source)}


def imported_modules(source: str) -> list[str]:
    modules: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            modules.append(node.module)
    return modules


@pytest.mark.parametrize("package", sorted(FORBIDDEN))
def test_package_imports_only_what_lies_to_its_left(package: str) -> None:
    files = [path for path in (ROOT / package).rglob("*.py") if path.relative_to(ROOT) != COMPOSITION_ROOT]
    assert files
    offenders = {
        str(path.relative_to(ROOT)): wrong
        for path in files
        if (wrong := imported_packages(path.read_text()) & FORBIDDEN[package])
    }
    assert not offenders


def test_folders_of_the_simulated_floors_import_one_way() -> None:
    imported = folder_imports(SIMULATED_FLOORS)
    assert set(imported) == set(FLOOR_FOLDERS)
    wrong = {folder: names - FLOOR_FOLDERS[folder] for folder, names in imported.items()}
    assert not any(wrong.values()), wrong


def folder_imports(package: Path) -> dict[str, set[str]]:
    """By folder of a package, the other folders of it that any file in it imports from."""
    folders = {path.name for path in package.iterdir() if (path / "__init__.py").exists()}
    prefix = ".".join(package.relative_to(ROOT).parts) + "."
    found: dict[str, set[str]] = {folder: set() for folder in folders}
    for folder in folders:
        for path in (package / folder).rglob("*.py"):
            modules = [name for name in imported_modules(path.read_text()) if name.startswith(prefix)]
            found[folder] |= {name.removeprefix(prefix).split(".")[0] for name in modules} - {folder}
    return found


def test_nothing_imports_the_composition_root() -> None:
    offenders = [
        str(path)
        for package in FORBIDDEN
        for path in (ROOT / package).rglob("*.py")
        if "deconflict.__main__" in path.read_text()
    ]
    assert not offenders


@pytest.mark.parametrize(
    ("library", "homes"),
    [
        ("fcl", {"deconflict/sweep/fcl_check.py"}),
        ("prometheus_client", {"metrics/monitoring/exposition.py"}),
        ("nats", {"deconflict/cluster/nats/bus.py", "deconflict/cluster/nats/subscriptions.py"}),
    ],
)
def test_a_library_with_traps_is_imported_in_one_place(library: str, homes: set[str]) -> None:
    importers = {
        str(path.relative_to(ROOT))
        for package in FORBIDDEN
        for path in (ROOT / package).rglob("*.py")
        if library in imported_packages(path.read_text())
    }
    assert importers <= homes


def foreign_names(path: Path) -> tuple[int, set[str]]:
    """How many functions of a file numba compiles, and the names in them that are imported from the packages."""
    tree = ast.parse(path.read_text())
    imported = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in FORBIDDEN
        for alias in node.names
    }
    compiled = [node for node in tree.body if isinstance(node, ast.FunctionDef) and is_compiled(node)]
    used = {node.id for one in compiled for part in one.body for node in ast.walk(part) if isinstance(node, ast.Name)}
    return len(compiled), used & imported


def is_compiled(function: ast.FunctionDef) -> bool:
    decorators = [one.func if isinstance(one, ast.Call) else one for one in function.decorator_list]
    return any(isinstance(one, ast.Name) and one.id in ("inner", "kernel") for one in decorators)


def test_a_kernel_uses_nothing_of_another_file() -> None:
    """What numba keeps on disk is dropped when the kernel's own file changes, and no other."""
    files = [path for package in FORBIDDEN for path in (ROOT / package).rglob("*.py")]
    found = {str(path.relative_to(ROOT)): foreign_names(path) for path in files}
    assert sum(compiled for compiled, _ in found.values()) > 10
    assert {path: names for path, (_, names) in found.items() if names} == {}


def test_a_role_that_needs_no_engine_starts_without_what_takes_seconds_to_import() -> None:
    """A role that died is back the sooner."""
    asked = "import sys, deconflict.__main__; print(*sorted({'numba', 'ortools', 'pandas'} & set(sys.modules)))"
    told = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True, cwd=ROOT)
    assert told.stdout.split() == []
