"""Warnings about silent robots, and false warnings about robots that have left: `python -m benchmarks.silences`.

It compares three cases: all robots report all the time while they are there; silent robots are assumed to stay for
ever; and the service, in which the probability that they are there decreases. On synthetic floors
(`benchmarks.silent_floor`) it is known which robots were there. With a folder of recordings in
`DECONFLICT_RECORDINGS` it also uses zara02, and random.blind with robots muted for 10 to 60 s.
"""

import argparse
import gzip
import json
import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from math import hypot, inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.random import Generator

from benchmarks.silent_floor import GRACE_S, Meeting, SilentFloor
from deconflict.engine import engine
from deconflict.foresight.presence.presence import Presence
from deconflict.foresight.presence.probably_left import PresenceChanges
from deconflict.settings.site import DEFAULT, Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory
from ingest.batch import Batch
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay

TOLD_S = 2.0
"""An advisory is in time if it was raised at least this long before the encounter, and is open at the encounter."""
MUTED_S, HEARD_S = (10.0, 60.0), (40.0, 100.0)
"""Ranges of the time for which a robot is muted, and of the time between."""
MOVED_M = 0.3
"""A muted robot that has moved less than this stands where it last reported."""
STANDS_M, STANDS_S = 0.02, (0.9, 2.1)
"""A robot that has moved less than this for this time has stopped."""
FRESH_MPS, FRESH_S = 0.3, 1.0
"""A protective stop counts if the robot was faster than this, and then stands for this long."""

Span = tuple[float, float]
Line = tuple[float, str, bool, str]
"""Arrival, robot, whether it is a status, and the line of the log."""
Figures = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Alert:
    """One advisory of a conflict."""

    pair: tuple[str, ...]
    raised_s: float
    cleared_s: float


class Staying(Presence):
    """A baseline in which silent robots stay for ever."""

    def receive(self, batch: Batch) -> Batch:
        return batch

    def advance(self, _: float) -> PresenceChanges:
        return PresenceChanges()


def alerts_of(
    lines: Iterable[str], kind: type[Presence] = Presence, site: Site = DEFAULT
) -> tuple[list[Alert], Figures]:
    """The advisories of a replay of the lines, and its scores."""
    alerts: dict[str, Alert] = {}

    def add(_: float, revision: AnyAdvisory) -> None:
        if not isinstance(revision, ConflictAdvisory):
            return
        cleared_s = revision.updated_at.timestamp() if revision.state is AdvisoryState.CLEARED else inf
        alerts[revision.id] = Alert(revision.robots, revision.raised_at.timestamp(), cleared_s)

    with TemporaryDirectory() as folder, patch.object(engine, "Presence", kind):
        path = Path(folder) / "log.jsonl"
        path.write_text("".join(lines))
        reader = LogReader()
        scores = replay(reader, reader.read([path]), site, [0.3], on_advisory=add)["scores"][0]
    return list(alerts.values()), scores


def has_warning(alerts: Sequence[Alert], meeting: Meeting) -> bool:
    pair = tuple(sorted((meeting.silent, meeting.other)))
    return any(a.pair == pair and a.raised_s <= meeting.at_s - TOLD_S and a.cleared_s >= meeting.at_s for a in alerts)


def on_floor(seed: int, seconds: float) -> Iterator[Figures]:
    """The figures of one synthetic floor, in each case."""
    floor = SilentFloor(seed, seconds)
    meetings, gone = floor.meetings(), floor.gone_s()
    broken = {robot.uuid for robot in floor.robots if robot.breaks_s < inf}
    cases = {"all heard": (False, Staying), "for ever": (True, Staying), "fading": (True, Presence)}
    for case, (muted, kind) in cases.items():
        alerts, _ = alerts_of(floor.log(muted=muted), kind)
        warned = [meeting for meeting in meetings if has_warning(alerts, meeting)]
        yield {
            "floor": f"made {seed}",
            "way": case,
            "advisories": len(alerts),
            "about_gone": sum(_is_about_gone(alert, gone) for alert in alerts),
            "meetings": len(meetings),
            "told_of": len(warned),
            "with_broken": sum(meeting.silent in broken for meeting in meetings),
            "with_broken_told_of": sum(meeting.silent in broken for meeting in warned),
        }


def _is_about_gone(alert: Alert, gone: Mapping[str, Sequence[Span]]) -> bool:
    return any(begin_s <= alert.raised_s < end_s for uuid in alert.pair for begin_s, end_s in gone.get(uuid, ()))


def on_people(log: Path) -> Iterator[Figures]:
    """The replay's own figures about people who walk out of view, in each case."""
    lines = [line for _, _, _, line in _lines(log)]
    for way, kind in {"for ever": Staying, "fading": Presence}.items():
        _, scores = alerts_of(lines, kind)
        silences = scores["silences"]
        yield {
            "floor": log.name.removesuffix(".jsonl.gz"),
            "way": way,
            "advisories": silences["raised"],
            "about_gone": silences["about_gone"],
            "recall": round(scores["recall"], 3),
            "precision": round(scores["precision"], 3),
        }


class Tracks:
    """The positions of the robots of a log."""

    def __init__(self, lines: Iterable[Line]) -> None:
        self._of: dict[str, list[tuple[float, float, float]]] = {}
        for _, uuid, is_status, line in lines:
            if is_status:
                message = json.loads(line)["message"]
                place = message["location"]
                self._of.setdefault(uuid, []).append((_time_s(message["timestamp"]), place["x"], place["y"]))

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._of))

    def span(self, uuid: str) -> Span:
        return self._of[uuid][0][0], self._of[uuid][-1][0]

    def at(self, uuid: str, t_s: float) -> tuple[float, float]:
        track = self._of[uuid]
        after = min(max(bisect_right(track, (t_s, inf, inf)), 1), len(track) - 1)
        (begin_s, *begin), (end_s, *end) = track[after - 1], track[after]
        share = min(max((t_s - begin_s) / (end_s - begin_s), 0.0), 1.0)
        return begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1])

    def comes_to_stand(self, uuid: str) -> list[float]:
        """Times at which it has stood for about 1.5 s."""
        found, since = [], self._of[uuid][0]
        for each in self._of[uuid][1:]:
            if hypot(each[1] - since[1], each[2] - since[2]) > STANDS_M:
                since = each
            elif STANDS_S[0] <= each[0] - since[0] < STANDS_S[1]:
                found.append(each[0] + 0.15)
        return found


def muted_spans(tracks: Tracks, rng: Generator) -> dict[str, list[Span]]:
    """When each robot is muted. Half of these times begin after it has stopped."""
    spans: dict[str, list[Span]] = {}
    for uuid in tracks:
        begin_s, end_s = tracks.span(uuid)
        t_s, of_robot = begin_s + rng.uniform(20, 60), spans.setdefault(uuid, [])
        while t_s < end_s - MUTED_S[1]:
            stands = [at_s for at_s in tracks.comes_to_stand(uuid) if t_s <= at_s < t_s + MUTED_S[1]]
            if stands and rng.random() < 0.5:
                t_s = stands[0]
            of_robot.append((t_s, t_s + rng.uniform(*MUTED_S)))
            t_s = of_robot[-1][1] + rng.uniform(*HEARD_S)
    return spans


def on_muted(log: Path, stops: Path, seeds: int) -> Iterator[Figures]:
    """How many stops for silent robots that stand at their last reported position had a warning, in each case."""
    lines, fresh = list(_lines(log)), _fresh(stops)
    tracks = Tracks(lines)
    heard, _ = alerts_of((line for *_, line in lines), Presence)
    totals: dict[str, int] = dict.fromkeys(("meetings", "all heard", "for ever", "fading", "heard and fading"), 0)
    for seed in range(seeds):
        spans = muted_spans(tracks, np.random.default_rng(seed))
        left = [line for at_s, uuid, is_status, line in lines if not (is_status and _within(spans[uuid], at_s))]
        met = [meeting for meeting in fresh if _is_standing(meeting, spans, tracks)]
        for_ever, fading = (alerts_of(left, kind)[0] for kind in (Staying, Presence))
        totals["meetings"] += len(met)
        for way, alerts in (("all heard", heard), ("for ever", for_ever), ("fading", fading)):
            totals[way] += sum(has_warning(alerts, meeting) for meeting in met)
        totals["heard and fading"] += sum(
            has_warning(heard, meeting) and has_warning(fading, meeting) for meeting in met
        )
        yield {"floor": f"random.blind, muted, seeds to {seed}", **totals}


def _fresh(file: Path) -> list[Meeting]:
    """Protective stops as encounters. `other` is the robot that stopped."""
    stops = json.loads(gzip.decompress(file.read_bytes()))
    fresh = [stop for stop in stops if stop["v0"] > FRESH_MPS and stop["standing_s"] >= FRESH_S]
    return [Meeting(stop["by"], stop["robot"], stop["start"]) for stop in fresh]


def _is_standing(meeting: Meeting, spans: Mapping[str, Sequence[Span]], tracks: Tracks) -> bool:
    """Whether the robot that caused the stop is silent then and stands at its last reported position, and the other
    robot reports."""
    if any(begin_s <= meeting.at_s and meeting.at_s - 2 * TOLD_S < end_s for begin_s, end_s in spans[meeting.other]):
        return False
    for begin_s, end_s in spans[meeting.silent]:
        if begin_s + GRACE_S < meeting.at_s < end_s:
            heard, now = tracks.at(meeting.silent, begin_s), tracks.at(meeting.silent, meeting.at_s)
            return hypot(now[0] - heard[0], now[1] - heard[1]) < MOVED_M
    return False


def _within(spans: Sequence[Span], t_s: float) -> bool:
    return any(begin_s <= t_s < end_s for begin_s, end_s in spans)


def _lines(log: Path) -> Iterator[Line]:
    with gzip.open(log, "rt", encoding="utf-8") as file:
        for line in filter(str.strip, file):
            entry = json.loads(line)
            yield _time_s(entry["received"]), entry["message"]["uuid"], "location" in entry["message"], line


def _time_s(stamp: str) -> float:
    return datetime.fromisoformat(stamp).timestamp()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=600.0, help="length of each synthetic floor")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    found: list[Figures] = []

    def add_rows(rows: Iterable[Figures]) -> None:
        for row in rows:
            found.append(row)
            print(json.dumps(row), flush=True)

    for seed in range(args.seeds):
        add_rows(on_floor(seed, args.seconds))
    if recordings := os.environ.get("DECONFLICT_RECORDINGS"):
        folder = Path(recordings)
        add_rows(on_people(folder / "zara02.cv.jsonl.gz"))
        add_rows(on_muted(folder / "random.blind.plan.jsonl.gz", folder / "random.blind.stops.json.gz", args.seeds))
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
