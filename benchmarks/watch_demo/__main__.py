"""The advisories of the demo, and their true outcomes: `python -m benchmarks.watch_demo --minutes 10 --robots 12`.

It runs the demo's robots and the service with a simulated clock and without sockets. It prints one line for each
advisory: when it was raised, the robots, the probability, its true outcome, and how it ended. The last lines are the
figures of situations, as those of a replay (`docs/replay.md`) but by what truly happened.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks.watch_demo.judging import rows_of, stops_of, summary
from benchmarks.watch_demo.situation_truth import situation_truth
from benchmarks.watch_demo.watching import Watch
from deconflict.simulation.demo.advice_follower import Follow
from metrics.report.quality_sections import sentence


def line(row: dict[str, Any]) -> str:
    """One advisory as a line of text."""
    clock = f"{row['raised_s'] // 60:3.0f}:{row['raised_s'] % 60:04.1f}"
    if row["kind"] != "conflict":
        return f"{clock}  {row['kind']}: {row['summary']}"
    stood = "/".join(f"{s:.0f}" for s in row["stood_s"])
    onset = "" if row["onset_s"] is None else f" at {row['onset_s'] - row['raised_s']:+.1f} s"
    open_s = "" if row["cleared_s"] is None else f"{row['cleared_s'] - row['raised_s']:.0f} s: "
    gap = "-" if row["gap_m"] is None else f"{row['gap_m']:.1f}"
    probability = "-" if row["probability"] is None else f"{row['probability']:.2f}"
    who, odd = " + ".join(row["names"]), " | " + ", ".join(row["odd"]) if row["odd"] else ""
    foreseen = f"p {probability} in {row['time_to_conflict_s']:4.1f} s, {row['separation_m']:.1f} m"
    now = f"now {gap:>4} m apart, stood {stood:>7} s"
    came = f"{row['became']}{onset} | {open_s}{row['ended'] or 'open'}"
    return f"{clock}  {who:31} {row['encounter_class']:19} {foreseen}; {now} | {came}{odd}"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--minutes", type=float, default=10.0)
    options.add_argument("--robots", type=int, default=12)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument(
        "--follow", type=Follow, choices=list(Follow), default=Follow.NONE, help="advice that robots follow"
    )
    options.add_argument("--site", type=Path, help="by default the demo's")
    options.add_argument("--json", type=Path, help="also write the results to this file")
    args = options.parse_args()
    began, seconds = time.perf_counter(), args.minutes * 60
    watch = Watch(args.robots, args.seed, args.site, args.follow)
    watch.run(seconds)
    rows = rows_of(watch, seconds)
    figures = summary(watch, rows, args.robots, seconds)
    situations = watch.situation_scores.figures(situation_truth(watch, seconds))
    for row in rows:
        print(line(row))
    print(f"{seconds / (time.perf_counter() - began):.0f} times real time", file=sys.stderr)
    print(json.dumps(figures, indent=2))
    print(sentence(situations))
    print(json.dumps({name: value for name, value in situations.items() if name != "cases"}, indent=2))
    if args.json:
        document = {"summary": figures, "advisories": rows, "stops": stops_of(watch, rows), "situations": situations}
        args.json.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
