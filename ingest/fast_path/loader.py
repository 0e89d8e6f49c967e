"""What is compiled of reading a message, once it is loaded: without, the same is read, but slower.

Loading brings numba, which takes half a second and 60 MB: whoever has died is back sooner without, and who has little
to read has no use for it.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from ingest.languages.massrobotics.path_points import Path, Points
from ingest.port.connection import Connection

if TYPE_CHECKING:
    from ingest.batch import Floats
    from ingest.fast_path.repeat_status import Manner
    from ingest.fast_path.status_scanner import Letters
    from ingest.fleet.forecast import Sighting, View
    from ingest.fleet.robot import Robot

letters: "Callable[[bytes], Letters | None] | None" = None
"""`ingest.fast_path.status_scanner.letters`"""
points: Callable[[bytes], Points | None] | None = None
"""`ingest.fast_path.status_scanner.points`"""
follow: "Callable[[Path, Sighting, View], tuple[Floats, tuple[int, ...]] | None] | None" = None
"""`ingest.fast_path.path_kernels.follow`"""
manner: "Callable[[Robot, Letters, Connection, str | None], Manner | None] | None" = None
"""`ingest.fast_path.repeat_status.manner`"""
placed: "Callable[[float, float, float, Floats], tuple[float, float, float]] | None" = None
"""`ingest.fast_path.path_kernels.placed`"""


def load() -> None:
    """Read by compiled code from now on. What is not on disk yet is compiled, which takes some seconds."""
    global letters, points, follow, manner, placed
    from ingest.fast_path import path_kernels, repeat_status, status_scanner  # noqa: PLC0415 - brings numba

    letters, points, manner = status_scanner.letters, status_scanner.points, repeat_status.manner
    follow, placed = path_kernels.follow, path_kernels.placed
