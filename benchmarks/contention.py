"""What slots cost to work out, and what they save: `python -m benchmarks.contention [--json FILE]`.

50 resources of one place each; robots come within 15 minutes and stay half a minute to two; each resource is one solve.
The gap is the share of first come, first served's waiting that the advice saves; the open share is what may still lie
between the advice and the bound.
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
    first_come_s = sum(one.first_come_cost_s or 0.0 for one in advice)
    cost_s, bound_s = sum(one.cost_s for one in advice), sum(one.bound_s for one in advice)
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
        "proven": sum(one.proven_optimal for one in advice),
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
