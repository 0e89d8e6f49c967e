"""Errors of maps found from driving, on floors where they are known: `python -m benchmarks.driven_maps --seeds 10`.

Each vendor gets a frame of its own by a random turn and shift, and noise of 0.05 to 0.1 m. A proposal is wrong if it is
off by more than 0.2 m anywhere that its robots drive, or by more than 1 degree. Exit code 1 if one is. Recordings in
the folder that DECONFLICT_RECORDINGS names are split in two.
"""

import argparse
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from benchmarks.driven_maps.driven_floors import DrivenFloor, floors_of, recorded
from ingest.batch import Floats
from ingest.frames.driven.driven_places import DrivenPlacesSum
from ingest.frames.driven.line_fit import rotation
from ingest.frames.driven.map_search import DrivenFrame, FoundMap, found_map
from ingest.frames.driven.shared_moments import MomentsSum

PEOPLE = "Walkers"
WRONG_M, WRONG_DEG = 0.2, 1.0
RECORDINGS = ("zara02.cv", "mrclam7.cv", "random.blind.plan", "random.coordinated.plan")


@dataclass(frozen=True, slots=True)
class Outcome:
    """One search: how far off the transform is that was found, proposed or not."""

    doubt: str
    off_m: float
    off_deg: float
    stated_m: float

    @property
    def is_wrong(self) -> bool:
        return not self.doubt and (self.off_m > WRONG_M or self.off_deg > WRONG_DEG)


def frame_of(points_m: Floats, width_m: Floats) -> DrivenFrame:
    """`points_m` (s, n, 2)"""
    places, moments = DrivenPlacesSum(), MomentsSum()
    for robot, half_m in enumerate((width_m / 2).tolist()):
        for t_s, (x, y) in enumerate(points_m[:, robot].tolist()):
            if np.isfinite(x):
                places.add(str(robot), t_s, x, y)
                moments.add(str(robot), t_s, x, y, half_m)
    return DrivenFrame(places.places(), moments.moments())


def outcome(floor: DrivenFloor, vendor: str, rng: np.random.Generator) -> Outcome:
    turn_rad, shift_m, noise_m = rng.uniform(-np.pi, np.pi), rng.uniform(-200, 200, 2), rng.uniform(0.05, 0.1)
    own = np.array([name == vendor for name in floor.vendor])
    known = np.array([name not in (vendor, PEOPLE) for name in floor.vendor])
    heard = floor.points_m + rng.normal(0.0, noise_m, floor.points_m.shape)
    sent = heard[:, own] @ rotation(turn_rad).T + shift_m
    found = found_map(frame_of(sent, floor.width_m[own]), frame_of(heard[:, known], floor.width_m[known]))
    return judged(found, floor.points_m[:, own].reshape(-1, 2), turn_rad, shift_m)


def judged(found: FoundMap, points_m: Floats, turn_rad: float, shift_m: Floats) -> Outcome:
    fit, doubt = found.fit, str(found.doubt or "")
    points_m = points_m[np.isfinite(points_m[:, 0])]
    if fit is None or not len(points_m):
        return Outcome(doubt, np.nan, np.nan, np.nan)
    off_m = (points_m @ rotation(turn_rad).T + shift_m) @ fit.matrix.T + fit.shift_m - points_m
    off_deg = abs((np.degrees(fit.turn_rad + turn_rad) + 180) % 360 - 180)
    return Outcome(doubt, float(np.hypot(*off_m.T).max()), float(off_deg), fit.error_m(fit.reach_m))


def line(minutes: float, name: str, outcomes: Sequence[Outcome]) -> str:
    proposed = [each for each in outcomes if not each.doubt]
    refused = Counter(each.doubt for each in outcomes if each.doubt)
    off_m, off_deg = sorted(each.off_m for each in proposed), max((each.off_deg for each in proposed), default=0.0)
    errors = (
        f"{off_m[len(off_m) // 2]:6.3f} {off_m[-1]:6.3f} {off_deg:7.3f}" if off_m else f"{'-':>6} {'-':>6} {'-':>7}"
    )
    share = max((each.off_m / each.stated_m for each in proposed), default=0.0)
    why = ", ".join(f"{doubt} {count}" for doubt, count in refused.most_common())
    wrong = sum(each.is_wrong for each in outcomes)
    return f"{minutes:5g} {name:24} {len(proposed):4} of {len(outcomes):3} {errors} {share:6.2f} {wrong:6} {why}"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--minutes", type=float, nargs="+", default=[5, 15, 60])
    args = parser.parse_args(arguments)
    outcomes, before = defaultdict[tuple[float, str], list[Outcome]](list), None
    for seed in range(1, args.seeds + 1):
        for name, floor, vendors in floors_of(seed, round(60 * max(args.minutes)), before):
            before = floor if name == "hall" and not before else before
            for minutes in args.minutes:
                for number, vendor in enumerate(vendors):
                    rng = np.random.default_rng([seed, number, round(minutes)])
                    outcomes[minutes, name].append(outcome(floor.first(round(60 * minutes)), vendor, rng))
        print(f"seed {seed}", file=sys.stderr, flush=True)
    folder = Path(os.environ.get("DECONFLICT_RECORDINGS", "."))
    for path in (folder / f"{name}.jsonl.gz" for name in RECORDINGS):
        if path.is_file():
            floor = recorded(path)
            rngs = map(np.random.default_rng, range(3))
            outcomes[len(floor.points_m) / 60, path.name.partition(".jsonl")[0]] += [
                outcome(floor, "Basalt", rng) for rng in rngs
            ]
    print("  min floor                    proposed  median m  most m most deg of stated wrong  refused")
    for (minutes, name), found in sorted(outcomes.items(), key=lambda each: (each[0][1], each[0][0])):
        print(line(minutes, name, found))
    return int(any(each.is_wrong for each in chain.from_iterable(outcomes.values())))


if __name__ == "__main__":
    sys.exit(main())
