"""The processes of a running service, by role."""

from pathlib import Path


def children(pid: int) -> dict[str, int]:
    """Role to process id, of the service whose own id is given."""
    pids = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    commands = {int(pid): Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0") for pid in pids}
    return {command[3].decode(): number for number, command in commands.items()}
