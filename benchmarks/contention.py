"""The time to compute slot advice, and the waiting that it saves: `python -m benchmarks.contention [--json FILE]`.

There are 50 resources with a capacity of one. Robots arrive within 15 minutes and stay 30 to 120 s. Each resource is
one problem. `gap` is the share of the waiting under first come, first served that the advice saves. `open` is the
remaining share between the advice and the lower bound.
"""

import argparse
import json
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from deconflict.contention.queues.place_group import PlaceQueue
from deconflict.contention.queues.queue_forecast import ServiceRequest
from deconflict.contention.queues.slot_scheduling import advise_slots

NOW_S = 1_800_000_000.0
RESOURCES = 50


def queues(robots: int) -> list[PlaceQueue]:
    rng = np.random.default_rng(robots)
    wanted: list[list[ServiceRequest]] = [[] for _ in range(RESOURCES)]
    for number in range(robots):
        arrival_s, service_s = NOW_S + rng.uniform(0, 900), rng.uniform(30, 120)
        request = ServiceRequest(f"robot-{number:04d}", f"vendor-{number % 4}", arrival_s, service_s)
        wanted[int(rng.integers(RESOURCES))].append(request)
    return [PlaceQueue(f"dock-{row:02d}", 1, tuple(requests)) for row, requests in enumerate(wanted)]


def measured(robots: int) -> dict[str, Any]:
    taken_ms, advice = [], []
    for queue in queues(robots):
        begin = perf_counter()
        advice.append(advise_slots([queue], NOW_S))
        taken_ms.append(1e3 * (perf_counter() - begin))
    first_come_s = sum(answer.first_come_cost_s or 0.0 for answer in advice)
    cost_s, bound_s = sum(answer.cost_s for answer in advice), sum(answer.bound_s for answer in advice)
    return {
        "robots": robots,
        "resources": RESOURCES,
        "median_ms": float(np.median(taken_ms)),
        "max_ms": max(taken_ms),
        "sum_ms": sum(taken_ms),
        "first_come_s": first_come_s,
        "advised_s": cost_s,
        "gap": 1 - cost_s / first_come_s if first_come_s else 0.0,
        "open": 1 - bound_s / cost_s if cost_s else 0.0,
        "proven": sum(answer.proven_optimal for answer in advice),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = [measured(robots) for robots in (10, 100, 1_000)]
    for row in rows:
        print("  ".join(f"{key} {value:.4g}" for key, value in row.items()))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
