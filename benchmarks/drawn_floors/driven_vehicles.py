"""People are warned of vehicles with drivers: `python -m benchmarks.drawn_floors.driven_vehicles [--floors N]`.

On each floor people on foot and forklifts with drivers cross each other's way. All have devices of one vendor that say
where they are and how fast, and no path. Each floor is driven twice: with a site file that does not say what devices
stand for, and with one that does. Exit code 1 if people are warned of fewer vehicles with it, or of each other.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from benchmarks.drawn_floors.driving import SITE, Drive, drive
from benchmarks.drawn_floors.floor import tour
from benchmarks.drawn_floors.judging import AHEAD_S, SETTLED_S, meetings
from benchmarks.drawn_floors.motion import Robot, sent_by
from ingest.settings import Vendor

VENDOR, SIDE_M = "Tagline", 30.0
PEOPLE, VEHICLES = 12, 6
PERSON_MPS, VEHICLE_MPS = (0.8, 1.6), (1.8, 3.0)


@dataclass(frozen=True, slots=True)
class Encountered:
    """What was warned of. A meeting is warned of if a warning of its pair stands when it begins."""

    meetings: int
    """Of a person and a vehicle."""
    warned_of: int
    ahead_s: tuple[float, ...]
    """Of each of these, how long before it began the warning was raised."""
    raised: int
    """Warnings of a person and a vehicle."""
    raised_of_people: int
    """Warnings of two people."""

    @property
    def early(self) -> int:
        return sum(ahead_s >= AHEAD_S for ahead_s in self.ahead_s)


def mixed_floor(number: int, seconds: float) -> tuple[list[Robot], list[Robot]]:
    """People and driven vehicles, each on a way of its own: nobody gives way."""
    rng = np.random.default_rng([number, 31])
    kinds = [*[("person", PERSON_MPS, (0.5, 0.5))] * PEOPLE, *[("forklift", VEHICLE_MPS, (2.4, 1.2))] * VEHICLES]
    made = [
        Robot(
            f"{kind} {number} {row}",
            VENDOR,
            "10.1.0.1",
            tour(rng, SIDE_M, seconds, speeds_mps),
            *size_m,
            phase_s=round(float(rng.uniform(0, 1)), 3),
            says="speed",
            is_honest=True,
        )
        for row, (kind, speeds_mps, size_m) in enumerate(kinds)
    ]
    return made[:PEOPLE], made[PEOPLE:]


def encountered(number: int, seconds: float, *, is_known: bool) -> Encountered:
    """One floor, with a site file that says what the devices stand for, if `is_known`."""
    people, vehicles = mixed_floor(number, seconds)
    robots = [*people, *vehicles]
    by_kind = {"person": [each.uuid for each in people], "driven": [each.uuid for each in vehicles]}
    vendor = Vendor.model_validate({"name": VENDOR, "participants": by_kind if is_known else {}})
    site = SITE.model_copy(update={"vendors": (vendor,)})
    return judged(people, vehicles, drive(robots, sent_by(robots, seconds), seconds, site=site), seconds)


def judged(people: Sequence[Robot], vehicles: Sequence[Robot], found: Drive, seconds: float) -> Encountered:
    on_foot = {each.uuid for each in people}
    met, ahead_s = meetings(people, vehicles, SETTLED_S + AHEAD_S, seconds), list[float]()
    for pair, at_s in met:
        of_pair = (each for each in found.warnings.get(pair, ()) if each.raised_s <= at_s < each.cleared_s)
        if warning := next(of_pair, None):
            ahead_s.append(at_s - warning.raised_s)
    raised = {pair: len(warnings) for pair, warnings in found.warnings.items()}
    mixed = sum(count for pair, count in raised.items() if len(on_foot.intersection(pair)) == 1)
    of_people = sum(count for pair, count in raised.items() if on_foot.issuperset(pair))
    return Encountered(len(met), len(ahead_s), tuple(ahead_s), mixed, of_people)


def together(floors: Sequence[Encountered]) -> Encountered:
    ahead_s = tuple(each_s for floor in floors for each_s in floor.ahead_s)
    names = ("meetings", "warned_of", "raised", "raised_of_people")
    sums = {name: sum(getattr(floor, name) for floor in floors) for name in names}
    return Encountered(**sums, ahead_s=ahead_s)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.drawn_floors.driven_vehicles", description=__doc__)
    parser.add_argument("--floors", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=120.0)
    asked = parser.parse_args(arguments)
    print("| kinds in the site file | meetings | warned of | 2 s ahead | ahead, median | warnings | of two people |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    found = []
    for is_known in (False, True):
        floors = [encountered(number, asked.seconds, is_known=is_known) for number in range(asked.floors)]
        total = together(floors)
        shares = (f"{count} ({count / max(total.meetings, 1):.2f})" for count in (total.warned_of, total.early))
        ahead = f"{median(total.ahead_s):.1f} s" if total.ahead_s else "-"
        figures = total.meetings, *shares, ahead, total.raised, total.raised_of_people
        print(f"| {'yes' if is_known else 'no'} | {' | '.join(map(str, figures))} |")
        found.append(total)
    unknown, known = found
    is_worse = known.warned_of < unknown.warned_of or known.early < unknown.early
    return int(is_worse or known.raised_of_people > 0)


if __name__ == "__main__":
    sys.exit(main())
