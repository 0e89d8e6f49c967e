"""Kernels are kept on disk where that can be written to, and work where it can't."""

import subprocess
import sys
from pathlib import Path

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
