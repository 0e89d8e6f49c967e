"""The sweep: which robots come within the clearance, when first and how near: `from deconflict.sweep import sweep`."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deconflict.sweep.one_shot import Conflicts, sweep

__all__ = ["Conflicts", "sweep"]


def __getattr__(name: str) -> Any:
    """Loads the kernels with the first use: whoever needs another part of this folder starts without numba."""
    if name in __all__:
        from deconflict.sweep import one_shot  # noqa: PLC0415

        return getattr(one_shot, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
