"""The sweep: which robots come within the clearance, when, and how near. `from deconflict.sweep import sweep`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deconflict.sweep.sweep_once import Conflicts, Invalid, sweep

__all__ = ["Conflicts", "Invalid", "sweep"]


def __getattr__(name: str) -> Any:
    """Load the kernels at their first use, so that importing another part of this folder does not load numba."""
    if name in __all__:
        from deconflict.sweep import sweep_once  # noqa: PLC0415

        return getattr(sweep_once, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
