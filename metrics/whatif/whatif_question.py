"""A question as it is asked on the command line, and its answer."""

import argparse
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deconflict.settings.site import Site
from ingest.recording.log_reader import Event, LogReader
from metrics.replay.replay import replay
from metrics.scoring import compare
from metrics.whatif.answer import NO_ANSWER, WhatIfAnswer, WhatIfModel
from metrics.whatif.change import Change, ChangeError, named_outlines, one_way, priority, slow_zone, wider
from metrics.whatif.demand import Demand
from metrics.whatif.more_docks import more_docks
from metrics.whatif.recorded_tracks import RecordedFloor, recorded_floor
from metrics.whatif.simulated.ordered_places import demand_past_crossings, ordered
from metrics.whatif.suggested_changes import SuggestedChanges, suggested, warning_counts

HEAD = "A: as it is, B: with other settings. Robots drive as recorded: they are not driven again."


@dataclass(frozen=True, slots=True, eq=False)
class SettingsAnswer:
    """The scores of two replays of a log."""

    before: dict[str, Any]
    after: dict[str, Any]
    problems: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        return {"before": self.before, "after": self.after}

    def lines(self) -> list[str]:
        """The comparison for a person."""
        return [HEAD, *compare.page(self.before, self.after).splitlines()]


def settings_compared(logs: Sequence[Path], before: Site, after: Site) -> SettingsAnswer:
    """The log with these settings and with others."""
    return SettingsAnswer(_scores(logs, before), _scores(logs, after))


def _scores(logs: Sequence[Path], site: Site) -> dict[str, Any]:
    reader = LogReader()
    return replay(reader, reader.read(logs), site, [site.conflict.clearance_m])


__all__ = ["NO_ANSWER", "Answer", "answered", "settings_compared"]

Answer = WhatIfAnswer | SettingsAnswer | SuggestedChanges


def answered(
    events: Iterable[Event], logs: Sequence[Path], site: Site, args: argparse.Namespace
) -> WhatIfAnswer | SuggestedChanges:
    """The answer from a log, whose files are `logs`."""
    floor = recorded_floor(events, site)
    if not floor.tracks:
        raise ChangeError("no robot reports in the log: give a log of robots that report where they are")
    if args.suggest:
        return suggested(floor, site, warning_counts(logs, site), args)
    demand = demand_past_crossings(floor, site)
    return WhatIfModel(floor, demand, args.seeds, args.jobs).ask(change_of(args, site, floor, demand))


def change_of(args: argparse.Namespace, site: Site, floor: RecordedFloor, demand: Demand) -> Change:
    """The change that was asked about. Raises `ChangeError` if the floor does not have the place."""
    if args.reverse and not args.one_way:
        raise ChangeError("--reverse is for --one-way")
    if args.one_way:
        aisles = named_outlines(site, floor.floors, args.one_way)
        if len(aisles) > 1:
            raise ChangeError(f"{args.one_way!r} is on {len(aisles)} floors or in several parts: name one aisle")
        return one_way(aisles[0], demand, reverse=args.reverse)
    if args.follow_advice:
        return Change("robots follow the advice of situations", advised_by=site)
    if args.widen:
        return wider(named_outlines(site, floor.floors, args.widen[0]), demand, floor.losses, _metres(args.widen[1:]))
    if place := args.dock or args.order:
        places = named_outlines(site, floor.floors, place)
        return more_docks(places, demand) if args.dock else ordered(places, demand, floor.losses)
    if args.priority:
        return priority(args.priority, demand)
    return slow_zone(named_outlines(site, floor.floors, args.speed[0]), _share(args.speed[1]))


def _metres(texts: Sequence[str]) -> float | None:
    if not texts:
        return None
    [text, *more] = texts
    if more or not re.fullmatch(r"\d?\.\d+|[1-9](\.\d*)?", text) or float(text) < 0.1:
        raise ChangeError(f"{' '.join(texts)!r} is no width: give metres from 0.1 to 9.9, such as 1.5")
    return float(text)


def _share(text: str) -> float:
    if not re.fullmatch(r"0?\.\d+|1(\.0*)?", text) or float(text) < 0.1:
        raise ChangeError(f"{text!r} is no share of a speed: give a number from 0.1 to 1, such as 0.8")
    return float(text)
