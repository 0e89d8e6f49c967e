"""What is compiled of reading a message, once it is loaded: without, the same is read, but slower.

Loading brings numba, which takes half a second and 60 MB: whoever has died is back sooner without, and who has little
to read has no use for it.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from ingest.conformance import Findings
from ingest.paths import Path, Points

if TYPE_CHECKING:
    from ingest.forecast import Sighting, View
    from ingest.messages import Status
    from ingest.seam import Floats

status: "Callable[[bytes, str | None, Findings], Status | None] | None" = None
"""`ingest.plain.status`"""
points: Callable[[bytes], Points | None] | None = None
"""`ingest.plain.points`"""
follow: "Callable[[Path, Sighting, View], tuple[Floats, tuple[int, ...]] | None] | None" = None
"""`ingest.following.follow`"""
placed: "Callable[[float, float, float, Floats], tuple[float, float, float]] | None" = None
"""`ingest.following.placed`"""


def load() -> None:
    """Read by compiled code from now on. What is not on disk yet is compiled, which takes some seconds."""
    global status, points, follow, placed
    from ingest import following, plain  # noqa: PLC0415 - brings numba

    status, points, follow, placed = plain.status, plain.points, following.follow, following.placed
