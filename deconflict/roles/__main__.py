"""One process of the service, which the supervisor starts: `python -m deconflict.roles ROLE RUNTIME DATA`.

The composition root of a role. It loads what the role needs, and nothing of the command line.
"""

import gc
import os
import sys
from pathlib import Path
from typing import Any

from deconflict.roles.service import run_role
from deconflict.runtime.command_parsers import GC_THRESHOLDS, MISUSED
from deconflict.runtime.logging_setup import VARIABLE
from deconflict.runtime.logging_setup import begin as begin_log
from deconflict.runtime.rpc import PortTakenError
from ingest.languages.visible_text import visible_lines
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError


def main() -> int:
    """Run until the supervisor closes standard input. Returns the exit code."""
    gc.set_threshold(*GC_THRESHOLDS)
    begin_log(os.environ.get(VARIABLE, "text"))
    role, runtime, data = sys.argv[1:]
    try:
        run_role(role, Path(runtime), Path(data), _render)
    except (PortTakenError, SecretError, CertificateError) as error:
        sys.stderr.write(f"deconflict: {visible_lines(str(error))}\n")
        return MISUSED
    return 0


def _render(documents: list[dict[str, Any]]) -> tuple[bytes, str]:
    """The text of a scrape: see `Exposition`."""
    from metrics.monitoring.exposition import render  # noqa: PLC0415 - loaded with the first scrape

    return render(documents)


if __name__ == "__main__":
    sys.exit(main())
