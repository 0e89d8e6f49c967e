"""The fork server of the roles, which the supervisor starts: `python -m deconflict.roles RUNTIME DATA ROLE...`.

The composition root of the roles. It loads what they need, and nothing of the command line.
"""

import gc
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deconflict.roles.processes.fork_server import ForkServer
from deconflict.roles.processes.ports import PortTakenError
from deconflict.roles.service import load_role, run_role
from deconflict.runtime.command_parsers import GC_THRESHOLDS, MISUSED
from deconflict.runtime.logging_setup import VARIABLE
from deconflict.runtime.logging_setup import begin as begin_log
from ingest.languages.visible_text import visible_lines
from ingest.measures.measures import Measures
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError

if TYPE_CHECKING:
    from deconflict.roles.engine_role import PassJudge


def main() -> int:
    """Serve, or run a role in a forked process, until the supervisor closes standard input. Returns the exit code."""
    begin()
    runtime, data, *roles = sys.argv[1:]
    role = ForkServer(Path(runtime), roles, partial(load_role, Path(runtime))).serve()
    return 0 if role is None else run(role, Path(runtime), Path(data))


def begin() -> None:
    """Set up a process that runs a role."""
    gc.set_threshold(*GC_THRESHOLDS)
    begin_log(os.environ.get(VARIABLE, "text"))


def run(role: str, runtime: Path, data: Path) -> int:
    """Run a role until the supervisor closes standard input. Returns the exit code."""
    try:
        run_role(role, runtime, data, _render, _make_judge)
    except (PortTakenError, SecretError, CertificateError) as error:
        sys.stderr.write(f"deconflict: {visible_lines(str(error))}\n")
        return MISUSED
    return 0


def _render(documents: list[dict[str, Any]]) -> tuple[bytes, str]:
    """The text of a scrape: see `Exposition`."""
    from metrics.monitoring.exposition import render  # noqa: PLC0415 - loaded with the first scrape

    return render(documents)


def _make_judge(clearance_m: float, drawn_apart_m: float, measures: Measures) -> "PassJudge":
    from metrics.scoring.warnings.warning_judge import WarningJudge  # noqa: PLC0415 - loads kernels

    return WarningJudge(clearance_m, drawn_apart_m, measures)


if __name__ == "__main__":
    sys.exit(main())
