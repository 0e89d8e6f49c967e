"""Replays logs made from what people report of real senders: `python -m benchmarks.field_cases [FOLDER]`.

FOLDER is `field-cases` in the folder that DECONFLICT_RECORDINGS names, if it is not given. Each `NAME.jsonl.gz` is
replayed, with the site `NAME.site.toml` if there is one. A case has a time to the conflict that is to be stated when
the first warning of its pair is raised, or that there is to be no warning. Exit code 1 if a case is not right.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.planned_floors.comparison.service_parts import unchanged
from benchmarks.planned_floors.comparison.service_replay import replayed
from deconflict.settings.site import Site
from deconflict.settings.site_file import site_from_toml

NEAR_S = 1.0
"""A case is right if the stated time differs by no more than this."""
NO_WARNING: float | None = None
LEADS_S: dict[str, float | None] = {
    "corner.control": 8.7,
    "field-violation-while-driving": 8.7,
    "iso-status": NO_WARNING,
    "load-mm": 8.1,
    "load-small-mm": 8.0,
    "long-order": 4.9,
    "lower-case-estop": 8.7,
    "lower-case-fatal": NO_WARNING,
    "nan-in-battery": 8.6,
    "numeric-map": 8.6,
    "numeric-order-id": 8.7,
    "numeric-stamp": 8.6,
    "offset-and-z": 8.6,
    "passes-before": NO_WARNING,
    "passes-before.control": NO_WARNING,
    "rmf-massrobotics": 8.6,
    "rotation-edge": 9.0,
    "rotation-edge.control": 9.0,
    "sequence-ids-10-20-30": 9.65,
    "slower-than-the-limit": 8.5,
    "slower-than-the-limit.control": 8.5,
    "turns-on-the-spot": 0.6,
}
"""By case. In `turns-on-the-spot` and `long-order` the robot gets its order, or is first heard, that shortly before."""


@dataclass(frozen=True, slots=True)
class CaseResult:
    name: str
    wanted_s: float | None
    stated_s: float | None
    """None if there was no warning."""

    @property
    def is_right(self) -> bool:
        if self.wanted_s is None or self.stated_s is None:
            return self.wanted_s is self.stated_s
        return abs(self.wanted_s - self.stated_s) <= NEAR_S


def result(folder: Path, name: str) -> CaseResult:
    """What the service warns of in one case."""
    site_file = folder / f"{name}.site.toml"
    site = site_from_toml(site_file.read_bytes(), site_file) if site_file.is_file() else Site()
    published = replayed(folder / f"{name}.jsonl.gz", site, {"service": unchanged})["service"]
    conflicts = [revision for revision in published.revisions if revision["kind"] == "conflict"]
    return CaseResult(name, LEADS_S[name], conflicts[0]["time_to_conflict_s"] if conflicts else None)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.field_cases", description=__doc__)
    recordings = os.environ.get("DECONFLICT_RECORDINGS")
    default = Path(recordings) / "field-cases" if recordings else None
    parser.add_argument("folder", type=Path, nargs="?", default=default, metavar="FOLDER")
    folder = parser.parse_args(arguments).folder
    if folder is None or not folder.is_dir():
        print("name the folder of the cases, or set DECONFLICT_RECORDINGS", file=sys.stderr)
        return 2
    results = [result(folder, name) for name in LEADS_S if (folder / f"{name}.jsonl.gz").is_file()]
    print("| case | wanted, s | stated, s | |\n| --- | --- | --- | --- |")
    for case in results:
        verdict = "right" if case.is_right else "WRONG"
        print(f"| {case.name} | {_shown(case.wanted_s)} | {_shown(case.stated_s)} | {verdict} |")
    wrong = sum(not case.is_right for case in results)
    print(f"\n{len(results) - wrong} of {len(results)} cases are right")
    return int(wrong > 0)


def _shown(time_s: float | None) -> str:
    return "none" if time_s is None else f"{time_s:.1f}"


if __name__ == "__main__":
    sys.exit(main())
