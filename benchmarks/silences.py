"""Who is warned of robots that have fallen silent, and who of robots that have left: `python -m benchmarks.silences`.

Three ways: all robots heard throughout, as far as they are there; silent ones taken to be there for ever; and as the
service has it, so that they fade. On made-up floors (`benchmarks.silent_floor`) it is known who was there. With a
folder of recordings in `DECONFLICT_RECORDINGS` also on zara02, and on random.blind with robots muted for 10 to 60 s.
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
from deconflict.foresight.presence.lasting_silences import PresenceChanges
from deconflict.foresight.presence.presence import Presence
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay

TOLD_S = 2.0
"""An advisory is told in time so long before the meeting, if it stands then."""
MUTED_S, HEARD_S = (10.0, 60.0), (40.0, 100.0)
"""For how long a robot is muted, and heard in between."""
MOVED_M = 0.3
"""A muted robot that has moved less stands where it was heard last."""
STANDS_M, STANDS_S = 0.02, (0.9, 2.1)
"""A robot that has moved less for so long has come to stand."""
FRESH_MPS, FRESH_S = 0.3, 1.0
"""A protective stop counts from such a speed, and where the robot then stands for so long."""

Span = tuple[float, float]
Line = tuple[float, str, bool, str]
"""When it arrived, of which robot, whether it is a status, and the line of the log."""
Figures = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Alert:
    """One advisory of a conflict."""

    pair: tuple[str, ...]
    raised_s: float
    cleared_s: float


class Staying(Presence):
    """Silent robots are there for ever."""

    def receive(self, batch: Batch) -> Batch:
        return batch

    def advance(self, _: float) -> PresenceChanges:
        return PresenceChanges()


def alerts_of(lines: Iterable[str], kind: type[Presence] = Presence) -> tuple[list[Alert], Figures]:
    """The advisories that a replay of the lines tells, and its scores."""
    told: dict[str, Alert] = {}

    def tell(line: dict[str, Any]) -> None:
        at_s = datetime.fromisoformat(line["at"]).timestamp()
        if line["event"] == "raised":
            told[line["id"]] = Alert(tuple(line["robots"]), at_s, inf)
        elif line["event"] == "cleared":
            told[line["id"]] = Alert(tuple(line["robots"]), told[line["id"]].raised_s, at_s)

    with TemporaryDirectory() as folder, patch.object(engine, "Presence", kind):
        path = Path(folder) / "log.jsonl"
        path.write_text("".join(lines))
        reader = LogReader()
        scores = replay(reader, reader.read([path]), Site(), [0.3], on_line=tell)["scores"][0]
    return list(told.values()), scores


def is_told(alerts: Sequence[Alert], one: Meeting) -> bool:
    pair = tuple(sorted((one.silent, one.other)))
    return any(a.pair == pair and a.raised_s <= one.at_s - TOLD_S and a.cleared_s >= one.at_s for a in alerts)


def on_floor(seed: int, seconds: float) -> Iterator[Figures]:
    """What is told on one made-up floor, each way."""
    floor = SilentFloor(seed, seconds)
    meetings, gone = floor.meetings(), floor.gone_s()
    broken = {one.uuid for one in floor.robots if one.breaks_s < inf}
    ways = {"all heard": (False, Staying), "for ever": (True, Staying), "fading": (True, Presence)}
    for way, (muted, kind) in ways.items():
        alerts, _ = alerts_of(floor.log(muted=muted), kind)
        told = [one for one in meetings if is_told(alerts, one)]
        yield {
            "floor": f"made {seed}",
            "way": way,
            "advisories": len(alerts),
            "about_gone": sum(_is_about_gone(one, gone) for one in alerts),
            "meetings": len(meetings),
            "told_of": len(told),
            "with_broken": sum(one.silent in broken for one in meetings),
            "with_broken_told_of": sum(one.silent in broken for one in told),
        }


def _is_about_gone(alert: Alert, gone: Mapping[str, Sequence[Span]]) -> bool:
    return any(begin_s <= alert.raised_s < end_s for uuid in alert.pair for begin_s, end_s in gone.get(uuid, ()))


def on_people(log: Path) -> Iterator[Figures]:
    """What is told of people who walk out of view, each way, by the replay's own figures."""
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
    """Where the robots of a log were."""

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
        """When it has stood for about a second and a half."""
        found, since = [], self._of[uuid][0]
        for one in self._of[uuid][1:]:
            if hypot(one[1] - since[1], one[2] - since[2]) > STANDS_M:
                since = one
            elif STANDS_S[0] <= one[0] - since[0] < STANDS_S[1]:
                found.append(one[0] + 0.15)
        return found


def muted_spans(tracks: Tracks, rng: Generator) -> dict[str, list[Span]]:
    """When each robot is muted; half of the times from where it has come to stand."""
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
    """Of stops for silent robots that stand where they were heard last: how many are told of, each way."""
    lines, fresh = list(_lines(log)), _fresh(stops)
    tracks = Tracks(lines)
    heard, _ = alerts_of((line for *_, line in lines), Presence)
    totals: dict[str, int] = dict.fromkeys(("meetings", "all heard", "for ever", "fading", "heard and fading"), 0)
    for seed in range(seeds):
        spans = muted_spans(tracks, np.random.default_rng(seed))
        left = [line for at_s, uuid, is_status, line in lines if not (is_status and _within(spans[uuid], at_s))]
        met = [one for one in fresh if _is_standing(one, spans, tracks)]
        for_ever, fading = (alerts_of(left, kind)[0] for kind in (Staying, Presence))
        totals["meetings"] += len(met)
        for way, alerts in (("all heard", heard), ("for ever", for_ever), ("fading", fading)):
            totals[way] += sum(is_told(alerts, one) for one in met)
        totals["heard and fading"] += sum(is_told(heard, one) and is_told(fading, one) for one in met)
        yield {"floor": f"random.blind, muted, seeds to {seed}", **totals}


def _fresh(stops: Path) -> list[Meeting]:
    """Protective stops: who stopped is the other one."""
    told = json.loads(gzip.decompress(stops.read_bytes()))
    fresh = [one for one in told if one["v0"] > FRESH_MPS and one["standing_s"] >= FRESH_S]
    return [Meeting(one["by"], one["robot"], one["start"]) for one in fresh]


def _is_standing(one: Meeting, spans: Mapping[str, Sequence[Span]], tracks: Tracks) -> bool:
    """Whether the robot that was stopped for is silent by then, and stands where it was heard last; and the other one
    is heard."""
    if any(begin_s <= one.at_s and one.at_s - 2 * TOLD_S < end_s for begin_s, end_s in spans[one.other]):
        return False
    for begin_s, end_s in spans[one.silent]:
        if begin_s + GRACE_S < one.at_s < end_s:
            heard, now = tracks.at(one.silent, begin_s), tracks.at(one.silent, one.at_s)
            return hypot(now[0] - heard[0], now[1] - heard[1]) < MOVED_M
    return False


def _within(spans: Sequence[Span], t_s: float) -> bool:
    return any(begin_s <= t_s < end_s for begin_s, end_s in spans)


def _lines(log: Path) -> Iterator[Line]:
    with gzip.open(log, "rt", encoding="utf-8") as file:
        for line in filter(str.strip, file):
            told = json.loads(line)
            yield _time_s(told["received"]), told["message"]["uuid"], "location" in told["message"], line


def _time_s(stamp: str) -> float:
    return datetime.fromisoformat(stamp).timestamp()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=600.0, help="of each made-up floor")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    found: list[Figures] = []

    def tell(rows: Iterable[Figures]) -> None:
        for row in rows:
            found.append(row)
            print(json.dumps(row), flush=True)

    for seed in range(args.seeds):
        tell(on_floor(seed, args.seconds))
    if recordings := os.environ.get("DECONFLICT_RECORDINGS"):
        folder = Path(recordings)
        tell(on_people(folder / "zara02.cv.jsonl.gz"))
        tell(on_muted(folder / "random.blind.plan.jsonl.gz", folder / "random.blind.stops.json.gz", args.seeds))
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
