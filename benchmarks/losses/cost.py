"""The part of an engine's passes that the ledger of lost time takes: `python -m benchmarks.losses.cost`.

Robots of the demo's floor report to a fleet and an engine in this process. The processor time of passes is measured
as a whole, and without that of the ledger: finding losses, their places, and what was published before. What losses
share with the outcomes of warnings does not count: the reports' progress and interactions.
"""

import argparse
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from benchmarks.watch_demo.floor import Floor, Post
from benchmarks.watch_demo.watching import START_S
from deconflict.advisories.loss_warnings import LossWarnings
from deconflict.engine.engine import Engine
from deconflict.foresight.interactions.interaction_finder import InteractionFinder
from deconflict.foresight.losses import loss_finder
from deconflict.foresight.losses.loss_places import LossPlaces
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from ingest.measures.measures import Measures

LEDGER = (
    (loss_finder.LossFinder, "receive"),
    (loss_finder.LossFinder, "take"),
    (LossPlaces, "placed"),
    (LossWarnings, "note"),
    (LossWarnings, "notice_of"),
)
SHARED = ((InteractionFinder, "receive"), (loss_finder, "interaction_reports"))
SETTLING_SHARE = 1 / 3


def timed(owner: Any, name: str, spent_s: Counter[str], key: str) -> None:
    """Have a function add its processor time to `spent_s[key]`."""
    function: Callable[..., Any] = getattr(owner, name)

    def timing(*arguments: Any, **options: Any) -> Any:
        began_s = time.thread_time()
        try:
            return function(*arguments, **options)
        finally:
            spent_s[key] += time.thread_time() - began_s  # type: ignore[assignment]

    setattr(owner, name, timing)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--robots", type=int, default=1000)
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--seed", type=int, default=31)
    args = arguments.parse_args()
    spent_s, site = Counter[str](), load(demo_site())
    for functions, key in ((LEDGER, "ledger"), (SHARED, "shared")):
        for owner, name in functions:
            timed(owner, name, spent_s, key)
    timed(Engine, "receive", spent_s, "passes")
    timed(Engine, "step", spent_s, "passes")
    floor = Floor(args.robots, args.seed, START_S, site.conflict.clearance_m)
    post, fleet, engine = Post(), fast_fleet_of(site, Measures()), Engine(site)
    passes, lost_s = 0, 0.0
    while floor.world.t_s < args.seconds:
        post.carry(floor, fleet)
        engine.receive(fleet.next_batch(floor.now_s, passes == 0))
        engine.step(floor.now_s)
        passes += 1
        lost_s += sum(placed.loss.lost_s for placed in engine.losses)
        if floor.world.t_s < SETTLING_SHARE * args.seconds:
            spent_s.clear()
    share = (spent_s["ledger"] - spent_s["shared"]) / spent_s["passes"]
    print(f"{args.robots} robots, {lost_s:.0f} s lost: the ledger takes {share:.1%} of the passes")


if __name__ == "__main__":
    main()
