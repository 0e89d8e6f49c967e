"""How much of the time that robots lose to each other the service finds, and how much it invents.

The demo's floors know who loses how much to whom. Time that people lose is left out; time lost to people counts. A loss
is right if robot, other robot and time are right. The other figures count it whatever the other robot, and compare the
sums of each pair of vendors, place and kind minute by minute. All this once by the robots' plans, and once against the
usual times of their models, which are learned meanwhile.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from benchmarks.losses.loss_scores import (
    LossScore,
    against_usual,
    by_label,
    by_second,
    score_labels,
    score_pairs,
    score_robots,
    score_vendors,
)
from benchmarks.losses.losses_run import LossesRun, run
from benchmarks.watch_demo.watching import START_S
from deconflict.foresight.losses.loss_places import PlacedLoss

WAYS = "pair", "any robot", "vendors", "place", "kind"
Scores = tuple[LossScore, ...]
"""One for each of `WAYS`."""


def scores_of(floor: LossesRun, losses: Sequence[PlacedLoss]) -> Scores:
    found = by_second((placed.loss for placed in losses), floor.rows, START_S)
    rows = set(floor.robots)
    by_robots = [placed for placed in losses if floor.rows.get(placed.loss.robot) in rows]
    places = by_label(((placed.place, placed.loss) for placed in by_robots), START_S)
    kinds = by_label(((placed.loss.kind.value, placed.loss) for placed in by_robots), START_S)
    return (
        score_pairs(floor.true, found, floor.robots),
        score_robots(floor.true, found, floor.robots),
        score_vendors(floor.true, found, floor.robots, floor.vendors),
        score_labels(floor.by_place, places),
        score_labels(floor.by_kind, kinds),
    )


def total(scores: Sequence[LossScore]) -> LossScore:
    return LossScore(
        sum(score.true_s for score in scores), sum(score.found_s for score in scores),
        sum(score.right_s for score in scores),
    )  # fmt: skip


def line(title: str, scores: Scores) -> str:
    shares = (
        f"{way}: found {score.share_found:5.1%}, invented {score.share_invented:5.1%}"
        for way, score in zip(WAYS, scores, strict=True)
    )
    return f"{title:41} lost {scores[0].true_s:6.0f} s; " + "; ".join(shares)


def same(placed: PlacedLoss) -> PlacedLoss:
    return placed


def as_figures(totals: Scores) -> dict[str, float]:
    return {"lost_s": round(totals[0].true_s, 1)} | {
        f"{figure} by {way}": round(getattr(score, figure), 4)
        for way, score in zip(WAYS, totals, strict=True)
        for figure in ("share_found", "share_invented")
    }


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(prog="python -m benchmarks.losses", description=__doc__)
    options.add_argument("--robots", type=int, default=100, help="robots and people")
    options.add_argument("--seeds", type=int, nargs="+", default=[31, 32])
    options.add_argument("--minutes", type=float, default=6.0)
    options.add_argument("--without-paths", type=float, nargs="+", default=[0.0, 0.2], metavar="SHARE")
    options.add_argument("--json", type=Path, metavar="OUT.json")
    args = options.parse_args(arguments)
    document = {}
    for share in args.without_paths:
        floors = [run(args.robots, seed, 60 * args.minutes, share) for seed in args.seeds]
        for figure, losses in (("", same), (" against usual", against_usual)):
            scores = [scores_of(floor, list(map(losses, floor.found))) for floor in floors]
            for seed, each in zip(args.seeds, scores, strict=True):
                print(line(f"{share:.0%} without paths{figure}, seed {seed}", each), flush=True)
            totals = tuple(total(column) for column in zip(*scores, strict=True))
            print(line(f"{share:.0%} without paths{figure}, all", totals), flush=True)
            document[f"{share:g}{figure}"] = as_figures(totals)
    if args.json:
        args.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
