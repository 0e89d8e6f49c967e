"""CP-SAT is loaded when the first question needs it."""

import subprocess
import sys


def test_the_engine_loads_no_solver_at_its_start() -> None:
    asked = "import sys, deconflict.roles.engine_role; print(*{'ortools', 'pandas'} & set(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert loaded.stdout.split() == []
