"""Where files lie, and which of them may import which.

Imports run one way: `deconflict_client` <- `ingest` <- `deconflict` <- `metrics`, and inside each from later levels to
earlier ones. Only the composition roots see all: that of the command line, and that of a role's process.
"""

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
COMPOSITION_ROOTS = ("deconflict/__main__", "deconflict/roles/__main__")
LEVELS = {
    "": ["deconflict_client", "ingest", "deconflict", "metrics"],
    "deconflict_client": ["counted_nouns participant_kinds verbs", "advisory", "situations", "answers", "client"],
    "ingest": [
        "batch clocks kernels plain_files settings shapes",
        "sizes",
        "frames languages measures security",
        "port",
        "recording",
        "fast_path",
        "fleet",
    ],
    "deconflict": [
        "advisory runtime settings",
        "sweep",
        "advice foresight",
        "advisories",
        "contention operator",
        "adviser",
        "client engine",
        "cluster",
        "roles",
        "simulation",
    ],
    "metrics": [
        "monitoring truth",
        "scoring",
        "replay report",
        "replay_files",
        "conformance export replay_processes whatif",
        "commands",
    ],
    "benchmarks/planned_floors": ["truth", "logs", "floors scoring", "comparison"],
}
"""By folder, its entries from the ground up. An entry may import entries of earlier levels and of its own level."""
MOST_ENTRIES = {"deconflict": 16, "ingest": 15, "metrics": 12}
"""Without `__init__.py` and `py.typed`; of any other folder a dozen."""
MOST_LINES_OF_A_FILE, MOST_LINES_OF_A_FUNCTION = 350, 40
MOST_PARAMETERS = 16
JSON_KEYS = "deconflict/simulation/drills/drill_outcomes.py"
"""Its fields are keys of the JSON output, which keep their names."""
RIDDLES = {"told", "said", "one", "word"}
REPEATED_NAMES = {"__init__", "__main__"}
PACKAGES = ("deconflict_client", "ingest", "deconflict", "metrics")


def files(folder: str) -> Iterator[Path]:
    return (ROOT / folder).rglob("*.py")


@cache
def nodes(source: str) -> list[ast.AST]:
    return list(ast.walk(ast.parse(source)))


@cache
def imported_modules(source: str) -> list[str]:
    """Every module, and every name from a module, that a file imports: `a.b` and `a.b.c` of `from a.b import c`."""
    modules: list[str] = []
    for node in nodes(source):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            modules += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return modules


def entry_of(path: Path) -> str | None:
    """A module's file without its suffix, or its folder, from the root; None where there is no such module."""
    if (ROOT / path.with_suffix(".py")).is_file():
        return str(path)
    return str(path / "__init__") if (ROOT / path / "__init__.py").is_file() else None


def imports() -> Iterator[tuple[str, str]]:
    """Each import of the product and the simulated floors: the importing file and the imported one."""
    for path in chain.from_iterable(map(files, (*PACKAGES, "benchmarks/planned_floors"))):
        importer = str(path.relative_to(ROOT).with_suffix(""))
        for module in imported_modules(path.read_text()):
            imported = entry_of(Path(*module.split(".")))
            if imported and importer not in COMPOSITION_ROOTS:
                yield importer, imported


def siblings(importer: str, imported: str) -> tuple[str, str, str]:
    """The folder that holds both, and the entries of it in which they lie."""
    ours, theirs = importer.split("/"), imported.split("/")
    depth = next(i for i, (our, their) in enumerate(zip(ours, theirs, strict=False)) if our != their)
    return "/".join(ours[:depth]), ours[depth], theirs[depth]


@cache
def imports_between_siblings() -> dict[tuple[str, str, str], list[str]]:
    """By folder and two of its entries, the imports from the first into the second."""
    found = defaultdict(list)
    for importer, imported in imports():
        if importer != imported:
            found[siblings(importer, imported)].append(f"{importer}.py imports {imported}.py")
    return found


@pytest.mark.parametrize("folder", sorted(LEVELS))
def test_imports_run_from_later_levels_to_earlier_ones(folder: str) -> None:
    level_of = {entry: level for level, entries in enumerate(LEVELS[folder]) for entry in entries.split()}
    wrong = [
        f"turn round: {line}"
        for (home, ours, theirs), lines in imports_between_siblings().items()
        if home == folder and ours in level_of and level_of[ours] < level_of.get(theirs, len(level_of))
        for line in lines
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("folder", sorted(LEVELS))
def test_every_entry_of_a_folder_has_a_level(folder: str) -> None:
    present = {
        path.stem for path in (ROOT / folder).iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    if folder:
        assert present - REPEATED_NAMES == set(" ".join(LEVELS[folder]).split())


def test_the_client_imports_only_what_its_wheel_installs() -> None:
    project = tomllib.loads((ROOT / "deconflict_client" / "pyproject.toml").read_text())["project"]
    installed = {re.split("[><=]", name)[0] for name in project["dependencies"]} | {"deconflict_client"}
    imported = {name.split(".")[0] for _, source in sources(["deconflict_client"]) for name in imported_modules(source)}
    assert imported <= installed | sys.stdlib_module_names


def test_no_folder_has_a_circle_of_imports() -> None:
    edges: defaultdict[str, defaultdict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    lines = imports_between_siblings()
    for home, ours, theirs in lines:
        edges[home][ours].add(theirs)
    circles = [
        f"{home or '.'}: {ours} and {theirs}: " + "; ".join(lines[home, ours, theirs])
        for home, ours, theirs in lines
        if ours in reached(edges[home], theirs)
    ]
    assert not circles, "\n".join(circles)


def reached(edges: dict[str, set[str]], start: str) -> set[str]:
    seen, waiting = set[str](), [start]
    while waiting:
        entry = waiting.pop()
        if entry not in seen:
            seen.add(entry)
            waiting += edges.get(entry, ())
    return seen


def test_no_folder_holds_more_than_a_person_takes_in() -> None:
    entries: defaultdict[str, set[str]] = defaultdict(set)
    for path in chain.from_iterable((ROOT / package).rglob("*") for package in PACKAGES):
        if path.is_file() and path.suffix == ".py" and path.stem != "__init__":
            parts = path.relative_to(ROOT).parts
            for depth in range(1, len(parts)):
                entries["/".join(parts[:depth])].add(parts[depth])
    crowded = {home: len(names) for home, names in entries.items() if len(names) > MOST_ENTRIES.get(home, 12)}
    assert not crowded


def test_no_file_name_stands_twice_in_the_product() -> None:
    names = Counter(path.stem for path in chain.from_iterable(map(files, PACKAGES)))
    assert {name for name, count in names.items() if count > 1} <= REPEATED_NAMES | {"settings"}


def sources(folders: Iterable[str] = PACKAGES) -> Iterator[tuple[str, str]]:
    """Path and source of each file in these folders."""
    for path in chain.from_iterable(map(files, folders)):
        yield str(path.relative_to(ROOT)), path.read_text()


def test_no_class_name_stands_twice_in_the_product() -> None:
    homes: defaultdict[str, list[str]] = defaultdict(list)
    for path, source in sources():
        for node in nodes(source):
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(path)
    assert not {name: paths for name, paths in homes.items() if len(paths) > 1}


def is_compiled(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    decorators = [node.func if isinstance(node, ast.Call) else node for node in function.decorator_list]
    return any(isinstance(node, ast.Name) and node.id in ("inner", "kernel") for node in decorators)


def test_functions_and_files_can_be_read_in_a_sitting() -> None:
    """Kernels may be longer: to pass the state of a loop from function to function would hide more than it shows."""
    long = []
    for path, source in sources():
        functions = [node for node in nodes(source) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
        if not any(map(is_compiled, functions)) and source.count("\n") > MOST_LINES_OF_A_FILE:
            long.append(f"{path}: {source.count(chr(10))} lines")
        for function in functions:
            lines = (function.end_lineno or 0) - function.lineno + 1
            if lines > MOST_LINES_OF_A_FUNCTION and not is_compiled(function):
                long.append(f"{path}: {function.name} has {lines} lines")
            parameters = len(function.args.posonlyargs + function.args.args + function.args.kwonlyargs)
            if parameters > MOST_PARAMETERS:
                long.append(f"{path}: {function.name} has {parameters} parameters; hand it a record")
    assert not long, "\n".join(long)


def test_a_long_kernel_has_the_reason_for_its_length_at_the_top_of_its_file() -> None:
    silent = [
        path
        for path, source in sources()
        if source.count("\n") > MOST_LINES_OF_A_FILE
        or any(
            (node.end_lineno or 0) - node.lineno >= MOST_LINES_OF_A_FUNCTION
            for node in nodes(source)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        )
        if " long because " not in " ".join((ast.get_docstring(ast.parse(source)) or "").split())
    ]
    assert not silent


def test_variables_are_named_for_what_they_hold() -> None:
    riddles = [
        f"{path}:{node.lineno}: {ast.unparse(node)}"
        for path, source in (*sources(), *sources(("tests", "benchmarks", "examples")))
        for node in nodes(source)
        if (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in RIDDLES)
        or (isinstance(node, ast.arg) and node.arg in RIDDLES)
        if path != JSON_KEYS
    ]
    assert not riddles, "\n".join(riddles)


def test_tests_lie_in_the_folders_of_what_they_test() -> None:
    homeless = [
        str(path.relative_to(ROOT))
        for path in chain.from_iterable(files(f"tests/{package}") for package in PACKAGES)
        if not (ROOT / path.relative_to(ROOT / "tests").parent).is_dir()
    ]
    assert not homeless


def test_tests_import_helpers_and_no_other_tests() -> None:
    wrong = {
        str(path.relative_to(ROOT)): modules
        for path in files("tests")
        if (modules := {name for name in imported_modules(path.read_text()) if ".test_" in name})
    }
    assert not wrong, wrong


def test_nothing_imports_a_composition_root() -> None:
    offenders = [
        str(path)
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if any(f"{root.replace('/', '.')}" in path.read_text() for root in COMPOSITION_ROOTS)
    ]
    assert not offenders


@pytest.mark.parametrize(
    ("library", "homes"),
    [
        ("fcl", {"deconflict/sweep/fcl_check.py", "deconflict/sweep/shapes/fcl_shapes.py"}),
        ("prometheus_client", {"metrics/monitoring/exposition.py"}),
        ("nats", {str(path.relative_to(ROOT)) for path in files("deconflict/cluster/nats")}),
    ],
)
def test_a_library_with_traps_is_imported_in_one_place(library: str, homes: set[str]) -> None:
    importers = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if library in {name.split(".")[0] for name in imported_modules(path.read_text())}
    }
    assert importers <= homes


NO_ENGINE = {"numba", "ortools", "pandas", "scipy"}
NO_FACE = {"fastapi", "prometheus_client", "pyproj", "rich", "uvicorn"}


@pytest.mark.parametrize(
    ("modules", "slow"),
    [
        ("deconflict.__main__", NO_ENGINE | {"fastapi", "httpx", "pyproj", "rich", "yaml"}),
        ("deconflict.roles.__main__", NO_ENGINE | NO_FACE),
        ("deconflict.roles.__main__, deconflict.roles.receiver_role", NO_ENGINE | NO_FACE),
        ("deconflict.roles.__main__, deconflict.roles.operator_role", NO_ENGINE | {"pyproj"}),
        ("deconflict.roles.engine_role", {"scipy.sparse", "scipy.spatial", "scipy.special"}),
    ],
)
def test_a_process_starts_without_what_it_does_not_need(modules: str, slow: set[str]) -> None:
    """A role that died is back the sooner, and takes less memory."""
    asked = f"import sys, {modules}; print(*sorted({slow} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == []
