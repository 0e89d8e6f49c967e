"""Kernels are kept on disk where that can be written to, and work where it can't."""

import ast
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = """
import numba
from ingest.kernels import inner, kernel

@inner
def half(x):
    return x / 2

@kernel(numba.float64(numba.float64))
def quarter(x):
    return half(half(x))

print(quarter(1.0), sum(quarter.stats.cache_hits.values()), len(quarter.stats.cache_misses))
"""


def run(module: Path, home: Path) -> list[str]:
    environment = {"HOME": str(home), "XDG_CACHE_HOME": str(home), "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, str(module)], env=environment, check=True, capture_output=True, text=True, cwd=module.parent
    )
    return done.stdout.split()


def test_a_second_process_takes_the_kernel_from_disk(tmp_path: Path) -> None:
    module = tmp_path / "made.py"
    module.write_text(SOURCE)
    assert run(module, tmp_path) == ["0.25", "0", "1"]
    assert run(module, tmp_path) == ["0.25", "1", "0"]


def test_a_kernel_that_changed_is_compiled_anew(tmp_path: Path) -> None:
    module = tmp_path / "made.py"
    module.write_text(SOURCE)
    run(module, tmp_path)
    module.write_text(SOURCE.replace("x / 2", "x / 4.0"))
    assert run(module, tmp_path)[:2] == ["0.0625", "0"]


PROCESSOR = """
from llvmlite import binding

features = binding.get_host_cpu_features()
features["{missing}"] = False
binding.get_host_cpu_name = lambda: "{name}"
binding.get_host_cpu_features = lambda: features
"""


@pytest.mark.skipif(platform.machine() != "x86_64", reason="kernels are compiled for one processor elsewhere")
def test_a_kernel_that_another_processor_compiled_is_taken_from_disk(tmp_path: Path) -> None:
    module, processor = tmp_path / "made.py", tmp_path / "processor.py"
    module.write_text("import processor\n" + SOURCE)
    processor.write_text("")
    assert run(module, tmp_path) == ["0.25", "0", "1"]
    processor.write_text(PROCESSOR.format(name="ivybridge", missing="avx2"))
    assert run(module, tmp_path) == ["0.25", "1", "0"]
    processor.write_text(PROCESSOR.format(name="core2", missing="sse4.2"))
    assert run(module, tmp_path) == ["0.25", "0", "1"], "it could not run that code"


HELPER = """
from ingest.kernels import inner

PARTS = 2

@inner
def half(x):
    return x / PARTS
"""
SHARING = """
import numba
from ingest.kernels import kernel
from helper import half, PARTS

@kernel(numba.float64(numba.float64))
def quarter(x):
    return half(half(x)) + (PARTS - 2)

print(quarter(1.0), sum(quarter.stats.cache_hits.values()), len(quarter.stats.cache_misses))
"""


def test_a_kernel_whose_helper_in_another_file_changed_is_compiled_anew(tmp_path: Path) -> None:
    helper, module = tmp_path / "helper.py", tmp_path / "made.py"
    helper.write_text(HELPER)
    module.write_text(SHARING)
    assert run(module, tmp_path) == ["0.25", "0", "1"]
    assert run(module, tmp_path) == ["0.25", "1", "0"]
    helper.write_text(HELPER.replace("x / PARTS", "x / 4.0"))
    assert run(module, tmp_path) == ["0.0625", "0", "1"]


def test_a_kernel_whose_constant_of_another_file_changed_is_compiled_anew(tmp_path: Path) -> None:
    constants, module = tmp_path / "helper.py", tmp_path / "made.py"
    constants.write_text("PARTS = 2\nhalf = 0.5\n")
    module.write_text(SHARING.replace("half(half(x))", "half * half * x"))
    assert run(module, tmp_path) == ["0.25", "0", "1"]
    constants.write_text("PARTS = 30\nhalf = 0.5\n")
    assert run(module, tmp_path) == ["28.25", "0", "1"]


def test_where_nothing_can_be_written_it_is_compiled_each_time(tmp_path: Path) -> None:
    """Files stand in the way of both directories, which holds for the superuser too."""
    module, home = tmp_path / "made.py", tmp_path / "home"
    module.write_text(SOURCE)
    (tmp_path / "__pycache__").write_text("")
    home.write_text("")
    assert run(module, home)[0] == "0.25"


PAIR = """
import numba
from ingest.kernels import kernel

@kernel(numba.float64(numba.float64), for_kernels=True)
def half(x):
    return x / 2

@kernel(numba.float64(numba.float64))
def quarter(x):
    return half(half(x))

print(quarter(1.0), sum(half.stats.cache_hits.values()), sum(quarter.stats.cache_hits.values()))
"""


def test_a_kernel_from_disk_is_compiled_into_another_one_that_is_not_there(tmp_path: Path) -> None:
    module = tmp_path / "made.py"
    module.write_text(PAIR)
    assert run(module, tmp_path) == ["0.25", "0", "0"]
    for kept in (tmp_path / "__pycache__").glob("made.quarter-*"):
        kept.unlink()
    assert run(module, tmp_path) == ["0.25", "1", "0"]


ROOT = Path(__file__).parents[2]


def compiled_functions(tree: ast.Module) -> Iterator[tuple[ast.FunctionDef, bool, bool]]:
    """Each compiled function of a file, whether it is a kernel, and whether other kernels may call it."""
    for node in tree.body:
        for decorator in node.decorator_list if isinstance(node, ast.FunctionDef) else ():
            text = ast.unparse(decorator)
            if text == "inner" or text.startswith("kernel("):
                assert isinstance(node, ast.FunctionDef)
                yield node, text != "inner", "for_kernels=True" in text


def called_names(tree: ast.Module, function: ast.FunctionDef) -> Iterator[tuple[str, str]]:
    """The module, "" for its own, and the name of each function that a compiled function calls by its name."""
    origins = {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    for node in ast.walk(function):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            yield origins.get(node.func.id, ("", node.func.id))


def test_a_kernel_that_other_kernels_call_says_so() -> None:
    """Else the caller can't be compiled while the other one is on disk."""
    paths = [path for package in ("deconflict", "ingest", "metrics") for path in (ROOT / package).rglob("*.py")]
    texts = {".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text() for path in paths}
    trees = {module: ast.parse(text) for module, text in texts.items() if "@kernel(" in text or "@inner" in text}
    kernels = {
        (module, function.name): for_kernels
        for module, tree in trees.items()
        for function, is_kernel, for_kernels in compiled_functions(tree)
        if is_kernel
    }
    called = {
        (origin or module, name)
        for module, tree in trees.items()
        for function, _, _ in compiled_functions(tree)
        for origin, name in called_names(tree, function)
    }
    assert called & kernels.keys() == {kernel for kernel, for_kernels in kernels.items() if for_kernels}
