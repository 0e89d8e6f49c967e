"""What an installation brings with it: `python -m tests.helpers.dependencies > docs/dependencies.md` writes it down."""

import re
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
HEAD = """# Dependencies

What `pip install -c constraints.txt .` installs besides this package, at the versions that were tested, and under which
licence each comes by its own word. `python -m tests.helpers.dependencies > docs/dependencies.md` writes this page anew.

`make audit` asks the vulnerability database of the Python Packaging Authority for each version in `constraints.txt`,
the developers' tools included, with pip-audit in an environment of its own. It fails where one is known to be
vulnerable, and where the database can't be asked: no answer is not a clean one. Run it for each release and whenever
`constraints.txt` changes, where PyPI itself is reached: of a mirror that has packages alone pip-audit says "not found
on PyPI". No result is kept here yet, because the database could not be asked. Instead published
advisories of what reads strangers' bytes were looked for by hand, in November 2026, which proves far less: those found
are mended in the pinned versions (starlette CVE-2024-47874 in 0.40.0, CVE-2025-62727 in 0.49.1 and CVE-2026-48710 in
1.0.1; idna CVE-2026-45409 in 3.15; h11 0.16.0 is itself such a release). Of websockets, uvicorn, msgspec, pydantic and
zstandard none was found. For protobuf's CVE-2026-0994 no version was found; nothing here gives it strangers' bytes.

| package | version | licence | needed by |
| --- | --- | --- | --- |
"""


def pinned() -> dict[str, str]:
    """Package to version, of `constraints.txt`."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    told = (line.split(";")[0].strip().split("==") for line in lines if "==" in line and not line.startswith("#"))
    return {canonicalize_name(name): version for name, version in told}


def needed() -> dict[str, set[str]]:
    """Every package that an installation brings, and which ask for it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    found: dict[str, set[str]] = {}
    waiting = [(Requirement(one), project["name"]) for one in project["dependencies"]]
    while waiting:
        wanted, by = waiting.pop()
        name = canonicalize_name(wanted.name)
        extras = wanted.extras or {""}
        seen = name in found
        found.setdefault(name, set()).add(by)
        if seen and not wanted.extras:
            continue
        asked = map(Requirement, distribution(name).requires or [])
        waiting += [(one, name) for one in asked if _applies(one, extras)]
    return found


def _applies(requirement: Requirement, extras: set[str]) -> bool:
    return requirement.marker is None or any(requirement.marker.evaluate({"extra": extra}) for extra in extras)


def licence(name: str) -> str:
    """As the package's own metadata has it."""
    told = distribution(name).metadata.json
    if told.get("license_expression"):
        return str(told["license_expression"])
    classifiers = [one.split(" :: ")[-1] for one in told.get("classifier", []) if one.startswith("License ::")]
    short = re.sub(r"\s+", " ", str(told.get("license", "")).strip())
    return (
        ", ".join(classifier for classifier in classifiers if classifier != "OSI Approved") or short[:60] or "not told"
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
