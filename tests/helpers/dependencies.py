"""What an installation brings with it: `python -m tests.helpers.dependencies > docs/dependencies.md` writes it down."""

import re
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
OLDEST_PYTHON = {"python_version": "3.11", "python_full_version": "3.11.0"}
"""An installation there brings most; the page is the same whichever Python writes it."""
HEAD = """# Dependencies

What does `pip install -c constraints.txt ./deconflict_client '.[cluster]'` bring along, as `locks/runtime.txt` has it?
The versions are those that were tested, each licence is the one in the metadata of the package.
`python -m tests.helpers.dependencies > docs/dependencies.md` writes this page.

## Known vulnerabilities

`make audit` looks up each version of `constraints.txt`, those of developers' tools included, in the vulnerability
database of the Python Packaging Authority. It fails if a version is known to be vulnerable, or if the database does not
answer. Run it for each release and after each change of `constraints.txt`. It needs PyPI itself: with a mirror that
serves only packages pip-audit reports "not found on PyPI".

The database could not be reached yet, so this page has no result of `make audit`. In November 2026 we searched by hand
for published advisories of the packages that read bytes from outside, which proves less. The tested versions contain
the fixes that were found:

- starlette: CVE-2024-47874, fixed in 0.40.0; CVE-2025-62727, fixed in 0.49.1; CVE-2026-48710, fixed in 1.0.1;
- idna: CVE-2026-45409, fixed in 3.15;
- h11: the tested version is itself a release with a fix;
- protobuf: CVE-2026-0994. No version with a fix was found. The service gives protobuf no bytes from outside;
- websockets, uvicorn, msgspec, pydantic and zstandard: none.

## Packages

| package | version | licence | needed by |
| --- | --- | --- | --- |
"""


def pinned() -> dict[str, str]:
    """Package to version, of `constraints.txt`."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    parts = (line.split(";")[0].strip().split("==") for line in lines if "==" in line and not line.startswith("#"))
    return {canonicalize_name(name): version for name, version in parts}


def needed() -> dict[str, set[str]]:
    """Every package that an installation brings, and which ask for it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    found: dict[str, set[str]] = {}
    asked = project["dependencies"] + project["optional-dependencies"]["cluster"]
    waiting = [(Requirement(dependency), project["name"]) for dependency in asked]
    while waiting:
        wanted, by = waiting.pop()
        name = canonicalize_name(wanted.name)
        extras = wanted.extras or {""}
        seen = name in found
        found.setdefault(name, set()).add(by)
        if seen and not wanted.extras:
            continue
        requirements = map(Requirement, distribution(name).requires or [])
        waiting += [(requirement, name) for requirement in requirements if _applies(requirement, extras)]
    return found


def _applies(requirement: Requirement, extras: set[str]) -> bool:
    marker = requirement.marker
    return marker is None or any(marker.evaluate(OLDEST_PYTHON | {"extra": extra}) for extra in extras)


def licence(name: str) -> str:
    """As the package's own metadata has it."""
    fields = distribution(name).metadata.json
    if fields.get("license_expression"):
        return str(fields["license_expression"])
    classifiers = [name.split(" :: ")[-1] for name in fields.get("classifier", []) if name.startswith("License ::")]
    short = re.sub(r"\s+", " ", str(fields.get("license", "")).strip())
    return (
        ", ".join(classifier for classifier in classifiers if classifier != "OSI Approved") or short[:60] or "unknown"
    )


def page() -> str:
    """The page."""
    versions = pinned()
    rows = (
        f"| {name} | {versions[name]} | {licence(name)} | {', '.join(sorted(by))} |\n"
        for name, by in sorted(needed().items())
    )
    return HEAD + "".join(rows)


if __name__ == "__main__":
    sys.stdout.write(page())
