"""How many black boxes of a busy floor replay exactly: `python -m benchmarks.boxes --robots 60 --minutes 10`.

It runs the demo's robots and the service with a simulated clock, records them, writes the boxes of all near misses as
the service does, and verifies each. It prints a line for each box, and the sums. The report of the same log says how
many of its nearest moments the boxes have, with the same separation and lead.
"""

import argparse
import json
import sys
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.watch_demo.floor import Floor, Post
from benchmarks.watch_demo.watching import START_S
from deconflict.engine.engine import Engine
from deconflict.engine.message_latency import LEARNED_EVERY_S
from deconflict.operator.blackbox.archive import FOLDER, Archive, Box
from deconflict.operator.blackbox.blackbox_request import WARM_UP_S, BlackBoxRequest, BoxSpan, LearnedSnapshot, NearPair
from deconflict.operator.blackbox.blackbox_writer import write_blackbox
from deconflict.operator.blackbox.keeper import BOXES_BEFORE, SHARED_FILE_S, known_of
from deconflict.operator.store.store import Store
from deconflict.runtime.learned_state import packed
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site import Site
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict_client.advisory import AnyAdvisory
from ingest.measures.measures import Measures
from ingest.recording.recorder import Recorder, quantise
from metrics.replay.blackbox_verify import verify


@dataclass
class RecordedFloor:
    """What the service kept of a floor."""

    site: Site
    data: Path
    near: list[NearPair] = field(default_factory=list)
    decided: list[AnyAdvisory] = field(default_factory=list)
    snapshots: list[LearnedSnapshot] = field(default_factory=list)

    @property
    def log(self) -> Path:
        return self.data / "log"


def recorded(data: Path, site: Site, robots: int, seed: int, seconds: float) -> RecordedFloor:
    """Run the demo's floor, which is the one of the site, and the service over it."""
    now_s = START_S
    kept = RecordedFloor(site, data)
    floor, post = Floor(robots, seed, START_S, site.conflict.clearance_m), Post()
    fleet, engine = fast_fleet_of(site, Measures()), Engine(site)
    recorder = Recorder(site.recorder, kept.log, Measures(), lambda: now_s)
    kept.snapshots.append(LearnedSnapshot(now_s, b"", {}, is_start=True))
    while floor.world.t_s < seconds:
        for sent in floor.step():
            post.put(*sent)
        now_s = quantise(floor.now_s)
        for arrival_s, raw, connection in post.arrived(now_s):
            rejected = fleet.receive(raw, quantise(arrival_s), connection)
            recorder.received(raw, quantise(arrival_s), connection, rejected)
        recorder.tick(now_s, followed=engine.followed)
        engine.receive(fleet.next_batch(now_s))
        kept.decided += engine.step(now_s)
        rows = engine.live.robots
        kept.near += [NearPair(a, b, now_s, (rows[a].vendor, rows[b].vendor)) for a, b in engine.near_misses]
        engine.advise(now_s)
        if now_s - kept.snapshots[-1].at_s >= LEARNED_EVERY_S:
            learned, under_way = packed(engine.learned()), packed(engine.under_way())
            kept.snapshots.append(LearnedSnapshot(now_s, learned, {}, under_way=under_way))
    recorder.close()
    return kept


def requests(kept: RecordedFloor, archive: Archive, store: Path, until_s: float) -> Iterator[BlackBoxRequest]:
    """What the service asks of the worker for each box."""
    settings, pairs = kept.site.blackbox, list(kept.near)
    while pairs:
        shared = [pair for pair in pairs if pair.at_s <= pairs[0].at_s + min(SHARED_FILE_S, settings.after_s)]
        pairs = pairs[len(shared) :]
        begins_s = shared[0].at_s - settings.before_s - WARM_UP_S
        at = bisect_right([snapshot.at_s for snapshot in kept.snapshots], begins_s)
        snapshot = kept.snapshots[max(at - 1, 0)]
        span = BoxSpan.around(shared, settings.before_s, settings.after_s, snapshot)
        if span.until_s <= until_s:
            known = known_of(archive.boxes()[-BOXES_BEFORE:])
            yield BlackBoxRequest(
                kept.site, kept.log, archive.directory, tuple(shared), span, snapshot, store, (), known
            )


def boxes_of(kept: RecordedFloor, directory: Path, until_s: float, last: int | None = None) -> list[Box]:
    """The boxes, or the last ones of them, written to a directory."""
    directory.mkdir(parents=True)
    with closing(Store(directory.parent)) as store:
        store.append(kept.decided)
    asked = requests(kept, Archive(directory), store.path, until_s)
    written = map(write_blackbox, [*asked][-last:] if last else asked)
    return list(filter(None, written))


def verified_line(directory: Path, box: Box) -> tuple[bool, bool, int, int]:
    """Print whether a box replays exactly. Returns that, whether it resumes, and the revisions that it has and that
    differ."""
    verdict = verify(directory / box["file"])
    differ = len(verdict.missing) + len(verdict.added)
    which = "resumed" if verdict.resumed else "started"
    print(
        f"{box['file']}  {which}, {len(box['near_misses'])} near misses, {box['bytes'] / 1e6:.2f} MB, "
        f"{verdict.published} revisions, {differ} differ",
        flush=True,
    )
    if verdict.missing or verdict.added:
        lines = [("-", line) for line in verdict.missing] + [("+", line) for line in verdict.added]
        sign, line = min(lines, key=lambda entry: entry[1]["at"])
        print(f"    first: {sign} {line['at']} {line['event']} {line['probability']} {line['summary'][:100]}")
    return verdict.same, verdict.resumed, verdict.published, differ


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--robots", type=int, default=60)
    options.add_argument("--minutes", type=float, default=10.0)
    options.add_argument("--seed", type=int, default=1)
    args = options.parse_args()
    with TemporaryDirectory() as folder:
        kept = recorded(Path(folder), load(demo_site()), args.robots, args.seed, args.minutes * 60)
        directory = Path(folder) / "boxes" / FOLDER
        boxes = boxes_of(kept, directory, START_S + args.minutes * 60)
        print_sums(boxes, [verified_line(directory, box) for box in boxes])


def print_sums(boxes: Sequence[Box], verified: Sequence[tuple[bool, bool, int, int]]) -> None:
    """Print how many boxes replay exactly."""
    sums = {
        which: {
            "boxes": len(found),
            "exact": sum(same for same, *_ in found),
            "revisions": sum(published for *_, published, _ in found),
            "differ": sum(differ for *_, differ in found),
        }
        for which, found in (
            ("started", [each for each in verified if not each[1]]),
            ("resumed", [each for each in verified if each[1]]),
        )
    }
    json.dump(sums | {"megabytes": sum(box["bytes"] for box in boxes) / 1e6}, sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main()
