"""A fork server with small roles: `python -m tests.deconflict.roles.processes.forking RUNTIME ROLE...`.

Each role is an action and a number. `ends 7` ends with code 7. `waits 1` runs until its standard input is closed, and
ends with code 1. `slow 1` takes long to load. `goes_on 1` goes on for a moment after it, and leaves a file.
"""

import os
import sys
import time
from pathlib import Path

from deconflict.roles.processes.fork_server import Beat, ForkServer

LOADED = "loaded"
"""The file in the runtime directory that has a line for each role that was loaded."""


def main() -> int:
    runtime, *roles = sys.argv[1:]

    def load(role: str, _: Beat) -> None:
        with (Path(runtime) / LOADED).open("a") as file:
            file.write(role + "\n")
        if role.startswith("slow"):
            time.sleep(600)

    role = ForkServer(Path(runtime), roles, load).serve()
    if role is None:
        return 0
    action, number = role.split()
    if action == "waits":
        os.read(sys.stdin.fileno(), 1)
    if action == "goes_on":
        os.read(sys.stdin.fileno(), 1)
        time.sleep(0.5)
        (Path(runtime) / role).touch()
    return int(number)


if __name__ == "__main__":
    sys.exit(main())
