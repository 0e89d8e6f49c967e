"""What is compiled of reading a message, once it is loaded: without, the same is read, but slower.

Loading brings numba, which takes half a second and 60 MB: whoever has died is back sooner without, and who has little
to read has no use for it.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from ingest.connection import Connection
from ingest.paths import Path, Points

if TYPE_CHECKING:
    from ingest.forecast import Sighting, View
    from ingest.onward import Manner
    from ingest.plain import Letters
    from ingest.robots import Robot
    from ingest.seam import Floats

letters: "Callable[[bytes], Letters | None] | None" = None
"""`ingest.plain.letters`"""
points: Callable[[bytes], Points | None] | None = None
"""`ingest.plain.points`"""
follow: "Callable[[Path, Sighting, View], tuple[Floats, tuple[int, ...]] | None] | None" = None
"""`ingest.following.follow`"""
manner: "Callable[[Robot, Letters, Connection, str | None], Manner | None] | None" = None
"""`ingest.onward.manner`"""
placed: "Callable[[float, float, float, Floats], tuple[float, float, float]] | None" = None
"""`ingest.following.placed`"""


def load() -> None:
    """Read by compiled code from now on. What is not on disk yet is compiled, which takes some seconds."""
    global letters, points, follow, manner, placed
    from ingest import following, onward, plain  # noqa: PLC0415 - brings numba

    letters, points, manner = plain.letters, plain.points, onward.manner
    follow, placed = following.follow, following.placed
