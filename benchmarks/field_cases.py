"""Replays logs made from what people report of real senders: `python -m benchmarks.field_cases [FOLDER]`.

FOLDER is `field-cases` in the folder that DECONFLICT_RECORDINGS names, if it is not given. Each `NAME.jsonl.gz` is
replayed, with the site `NAME.site.toml` if there is one. A case has a time to the conflict that is to be stated when
the first warning of its pair is raised, or that there is to be no warning. In a case of a mutual wait two robots stand
for each other before a free crossing: people are to be told soon, and the time is to be booked. A plan is to be
imported with its floors and places, or refused. Exit code 1 if a case is not right.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import shapely

from benchmarks.planned_floors.comparison.service_parts import unchanged
from benchmarks.planned_floors.comparison.service_replay import Published, replayed
from deconflict.settings.importers.plan import PlanError
from deconflict.settings.importers.plan_reader import WIDTH_M, imported_site
from deconflict.settings.shared_places import Polygon
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
"""By case of a conflict. In `turns-on-the-spot` and `long-order` the robot gets its order, or is first heard, that
shortly before."""


BOTH_STAND = {
    "crossing-paths": "2026-11-28T09:00:08.700000Z",
    "crossing-vda": "2026-11-28T09:00:08.700000Z",
}
"""By case of a mutual wait, from when both stand."""
FOUND_WITHIN_S, BOOKED_S = 15.0, 200.0
"""A mutual wait is to be found so soon, and so much is to be booked: twice the two minutes, but for the last part."""

REFUSED = "refused"
FOUND_IN_PLANS = {
    "fiducials.building.yaml": "L1: aisle 12.5 -10.0, charger 15.0 -10.0, lift 10.0 -10.0; "
    "L2: aisle 12.5 -10.0, charger 15.0 -10.0, lift 10.0 -10.0",
    "opentcs-two-floors.xml": "Ground floor: aisle 10.0 0.0; Upper floor: parking 0.0 0.0",
    "opentcs-layout-only.xml": REFUSED,
}
"""By plan, its floors with the kind and centre of each place, metres."""


@dataclass(frozen=True, slots=True)
class MutualWaitResult:
    name: str
    found_s: float | None
    """How long after both stood people were told; None if never."""
    lost_s: float
    crowded: int
    """Advisories that say that more robots are in a place than it takes."""

    @property
    def is_right(self) -> bool:
        is_found = self.found_s is not None and 0.0 <= self.found_s <= FOUND_WITHIN_S
        return is_found and self.lost_s >= BOOKED_S and not self.crowded


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
    published = _published(folder, name)
    conflicts = [revision for revision in published.revisions if revision["kind"] == "conflict"]
    return CaseResult(name, LEADS_S[name], conflicts[0]["time_to_conflict_s"] if conflicts else None)


def mutual_wait_result(folder: Path, name: str) -> MutualWaitResult:
    """When people are told of a mutual wait, and what is booked."""
    published = _published(folder, name)
    raised = [revision for revision in published.revisions if revision["state"] == "raised"]
    waits_s = [moment_s(revision["raised_at"]) for revision in raised if revision["kind"] == "deadlock"]
    crowded = sum(revision["kind"] == "double_occupancy" for revision in raised)
    found_s = min(waits_s) - moment_s(BOTH_STAND[name]) if waits_s else None
    return MutualWaitResult(name, found_s, published.lost_s, crowded)


def found_in_plan(path: Path) -> str:
    """The floors that an import of the plan gives, by name, with the kind and centre of each place."""
    try:
        site = imported_site(path, WIDTH_M).site
    except PlanError:
        return REFUSED
    return "; ".join(f"{datum.name}: {', '.join(map(_centred, site.drawn_on(datum.id)))}" for datum in site.datums)


def _centred(place: tuple[str, str, Polygon]) -> str:
    x_m, y_m = shapely.Polygon(place[2]).centroid.coords[0]
    return f"{place[0]} {x_m + 0.0:.1f} {y_m + 0.0:.1f}"


def moment_s(text: str) -> float:
    return datetime.fromisoformat(text).timestamp()


def _published(folder: Path, name: str) -> Published:
    site_file = folder / f"{name}.site.toml"
    site = site_from_toml(site_file.read_bytes(), site_file) if site_file.is_file() else Site()
    return replayed(folder / f"{name}.jsonl.gz", site, {"service": unchanged})["service"]


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
    waits = [mutual_wait_result(folder, name) for name in BOTH_STAND if (folder / f"{name}.jsonl.gz").is_file()]
    print("\n| mutual wait | found after, s | lost, s | too many in a place | |\n| --- | --- | --- | --- | --- |")
    for wait in waits:
        verdict = "right" if wait.is_right else "WRONG"
        print(f"| {wait.name} | {_shown(wait.found_s)} | {wait.lost_s:.1f} | {wait.crowded} | {verdict} |")
    plans = {name: found_in_plan(folder / name) for name in FOUND_IN_PLANS if (folder / name).is_file()}
    print("\n| plan | found | |\n| --- | --- | --- |")
    for name, found in plans.items():
        print(f"| {name} | {found} | {'right' if found == FOUND_IN_PLANS[name] else 'WRONG'} |")
    cases = [*(case.is_right for case in results), *(wait.is_right for wait in waits)]
    cases += [found == FOUND_IN_PLANS[name] for name, found in plans.items()]
    wrong = cases.count(False)
    print(f"\n{len(cases) - wrong} of {len(cases)} cases are right")
    return int(wrong > 0)


def _shown(time_s: float | None) -> str:
    return "none" if time_s is None else f"{time_s:.1f}"


if __name__ == "__main__":
    sys.exit(main())
