"""Who has left: `python -m benchmarks.who_left [--seeds 5]`.

Replays scenes whose truth is known (`scenes`), each with an engine that has learned nothing. Tells of all alerts the
share that concern somebody who is gone: they were raised, or still stood, when it had been silent for 5 s and never
came back. And of the meetings with robots that are silent for 5 s and still there the share that was warned of, at
least 2 s ahead and until it began.
"""

import argparse
import json
from collections.abc import Iterable, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.silences import alerts_of, has_warning
from benchmarks.silent_floor import HALL
from benchmarks.who_left.scenes import EVERY_S, scene_of
from benchmarks.who_left.walks import SILENT_S, START_S, log_of, meetings

END_S = 0.5
"""An alert may take so long to end."""
Figures = dict[str, Any]


def on_scene(kind: str, seed: int, seconds: float) -> Figures:
    """The figures of one scene."""
    scene = scene_of(kind, seed, seconds)
    alerts, _ = alerts_of(log_of(scene.walks, seconds, np.random.default_rng(seed), HALL), site=scene.site)
    gone_s = {walk.uuid: START_S + walk.ends_s + SILENT_S for walk in scene.walks}
    gone_s = {uuid: at_s if at_s + END_S < START_S + seconds else inf for uuid, at_s in gone_s.items()}
    met = list(meetings(scene.walks, seconds))
    return {
        "scene": kind,
        "seed": seed,
        "alerts": len(alerts),
        "raised on gone": sum(any(alert.raised_s >= gone_s[uuid] for uuid in alert.pair) for alert in alerts),
        "on gone": sum(any(alert.cleared_s > gone_s[uuid] + END_S for uuid in alert.pair) for alert in alerts),
        "meetings": len(met),
        "told of": sum(has_warning(alerts, meeting) for meeting in met),
    }


def totals(rows: Iterable[Figures]) -> list[Figures]:
    """By scene, the sums over its seeds, and their shares."""
    found: dict[str, Figures] = {}
    for row in rows:
        total = found.setdefault(row["scene"], {"scene": row["scene"]})
        for key in row.keys() - {"scene", "seed"}:
            total[key] = total.get(key, 0) + row[key]
    for total in found.values():
        total["on gone, share"] = round(total["on gone"] / max(total["alerts"], 1), 3)
        total["told of, share"] = round(total["told of"] / max(total["meetings"], 1), 3)
    return list(found.values())


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.who_left", description=__doc__)
    parser.add_argument("--scenes", nargs="+", choices=EVERY_S, default=list(EVERY_S))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=420.0, help="length of each scene")
    parser.add_argument("--json", type=Path, metavar="OUT.json")
    args = parser.parse_args(arguments)
    rows = [on_scene(kind, seed, args.seconds) for kind in args.scenes for seed in range(args.seeds)]
    for total in totals(rows):
        print(json.dumps(total), flush=True)
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
