"""What all tests share."""

from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import hypothesis
import pytest

PRODUCT = Path(__file__).parent.parent
PACKAGES = ("ingest", "deconflict", "metrics")

hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")


def pytest_configure() -> None:
    """Refuse to test what was compiled of another source than the one here."""
    if stale := stale_modules():
        told = ", ".join(str(path.relative_to(PRODUCT)) for path in stale)
        raise pytest.UsageError(f"compiled before they changed: {told}; run make compiled or make interpreted")


def stale_modules() -> list[Path]:
    """Sources that are newer than what this interpreter would import in their place."""
    suffix = EXTENSION_SUFFIXES[0]
    found = (path for package in PACKAGES for path in (PRODUCT / package).rglob(f"*{suffix}"))
    pairs = ((path, path.with_name(f"{path.name.removesuffix(suffix)}.py")) for path in found)
    return sorted(source for path, source in pairs if source.stat().st_mtime > path.stat().st_mtime)
