"""The processes of a running service, by role."""

from pathlib import Path


def children(pid: int) -> dict[str, int]:
    """Role to process id, of the service whose own id is given."""
    return {
        Path(f"/proc/{role}/comm").read_text().strip(): role
        for server in fork_servers(pid)
        for role in _children(server)
    }


def fork_servers(pid: int) -> list[int]:
    """The process ids of fork servers, of which a service has one at most."""
    return [child for child in _children(pid) if b"deconflict.roles" in Path(f"/proc/{child}/cmdline").read_bytes()]


def _children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
