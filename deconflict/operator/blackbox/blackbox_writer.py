"""Cuts one black box out of the recording: `deconflict replay FILE` then tells what the service told.

    {"before": HASH, "blackbox": {"site": {...}, "near_misses": [...], "learned": ..., ...}}
    {"before": HASH, "received": ...}      as in the log: messages, ticks, ends of connections
    {"before": HASH, "decided": "...Z", "advisory": {...}}
    {"before": HASH, "end": LINES}

What robots said last before the lead comes first, so that nobody who is quiet is missing.
"""

import base64
import json
import os
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import msgspec
import zstandard

from deconflict.advisory import ADVISORY, AdvisoryState, AnyAdvisory, ConflictAdvisory
from deconflict.operator.blackbox.archive import Box, Shelf
from deconflict.operator.blackbox.blackbox_request import Order
from deconflict.operator.blackbox.hash_chain import Chain
from deconflict.operator.blackbox.hindsight import tracks
from deconflict.operator.blackbox.near_misses import NearMiss, judged
from deconflict.operator.blackbox.published_advisories import Told, told_in
from deconflict.operator.blackbox.start_state import FORMAT
from deconflict.settings.site import Site
from ingest.languages.massrobotics import timestamps
from ingest.recording.log_reader import (
    UNREADABLE,
    EngineStarted,
    Event,
    Overtaken,
    Received,
    Tick,
    begun_s,
    lines_of,
    parsed,
    segments_until,
)

NEEDLESS = {"operator", "receiver", "webhooks", "mqtt", "store", "recorder", "blackbox"}
"""Parts of the site that a replay needs nothing of."""
SECRET = {"token", "certificate_names", "dial"}
"""And of its vendors."""
EARLIER_SEGMENTS = 1
"""Segments of the log before the one with the lead in which quiet robots' last words are looked for."""


def cut(order: Order) -> Box | None:
    """Write the file and register it; None where by what happened nobody came within the clearance.

    Passes over the log twice, a line at a time. Raises `OSError`.
    """
    told = told_in(order.store, [ADVISORY.validate_json(one) for one in order.waiting], order.span)
    misses = _misses(order, told.decided)
    if not misses:
        return None
    shelf = Shelf(order.shelf)
    chain = Chain(shelf.head())
    name = f"blackbox-{datetime.fromtimestamp(misses[0].met.began_s, UTC):%Y%m%dT%H%M%S%f}"[:-3] + "Z.jsonl.zst"
    path = order.shelf / name
    new = path.with_suffix(".new")
    with new.open("wb") as file:
        with zstandard.ZstdCompressor().stream_writer(file, closefd=False) as packed:
            for line in _lines(order, told, misses):
                packed.write(chain.link(line))
            packed.write(chain.end())
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)
    box: Box = {
        "file": name,
        "bytes": path.stat().st_size,
        "sha256": chain.head,
        "from": timestamps.write(order.span.from_s),
        "until": timestamps.write(order.span.until_s),
        "near_misses": [one.document() for one in misses],
    }
    shelf.add(box)
    return box


def _misses(order: Order, decided: list[AnyAdvisory]) -> list[NearMiss]:
    """The near misses as they happened, in order of time."""
    robots = {uuid for one in order.near for uuid in (one.a, one.b)}
    found, floors = tracks(order.site, _of(order, robots), robots)
    conflicts = [one for one in decided if isinstance(one, ConflictAdvisory)]
    every = (judged(one, found, floors, order.site, conflicts, order.span.until_s) for one in order.near)
    return sorted((one for one in every if one), key=lambda miss: (miss.met.began_s, miss.robots))


def _of(order: Order, robots: set[str]) -> Iterator[Received]:
    """The messages of some robots, and those that only a fleet can tell whose they are."""
    known = [uuid.encode() for uuid in robots]
    by_name = {one.name for one in order.site.vendors if one.names_as_uuid}
    for _, event in _events(order):
        if isinstance(event, Received) and not event.refused:
            raw = event.raw.lower()
            if event.connection.vendor in by_name or any(uuid in raw for uuid in known):
                yield event


def _lines(order: Order, told: Told, misses: list[NearMiss]) -> Iterator[bytes]:
    """Every line but the last, without the chain."""
    yield _line({"blackbox": _head(order, told, misses)})
    waiting = [(one.updated_at.timestamp(), one) for one in reversed(told.decided)]
    for line, event in _events(order):
        while waiting and waiting[-1][0] < _time(event, order.span.lead_s):
            at_s, one = waiting.pop()
            yield _line({"decided": timestamps.write(at_s), "advisory": one.model_dump(mode="json")})
        yield line
    for at_s, one in reversed(waiting):
        yield _line({"decided": timestamps.write(at_s), "advisory": one.model_dump(mode="json")})


def _head(order: Order, told: Told, misses: list[NearMiss]) -> dict[str, Any]:
    span, snapshot = order.span, order.snapshot
    restarts = [event for _, event in _events(order) if isinstance(event, EngineStarted)]
    return {
        "format": FORMAT,
        "site": _site(order.site),
        "from": timestamps.write(span.from_s),
        "until": timestamps.write(span.until_s),
        "engine_restarts": sum(one.now_s > span.engine_s + 1.0 for one in restarts),
        "near_misses": [one.document() for one in misses],
        "open": [one.model_dump(mode="json") for one in told.open],
        "encounters": _encounters(told),
        "burdens_s": snapshot.burdens_s if snapshot else {},
        "learned": base64.b64encode(snapshot.learned).decode() if snapshot else None,
    }


def _site(site: Site) -> dict[str, Any]:
    """What a replay reads messages by, without whatever could be a secret."""
    told = site.model_dump(mode="json", exclude=NEEDLESS)
    for vendor in told["vendors"]:
        for key in SECRET:
            del vendor[key]
    return told


def _encounters(told: Told) -> list[list[Any]]:
    """How many encounters each pair of the decisions had had when the engine began."""
    counted: dict[tuple[str, str], int] = {}
    for one in (*told.open, *told.decided):
        if isinstance(one, ConflictAdvisory):
            new = one.state is AdvisoryState.RAISED
            counted.setdefault(one.robots, one.encounter - new)
    return [[*pair, count] for pair, count in sorted(counted.items())]


def _events(order: Order) -> Iterator[tuple[bytes, Event]]:
    """The lines of the log that the box holds, in order, and what they say."""
    span, last_words = order.span, dict[tuple[str | None, str, bool], tuple[bytes, Event]]()
    for line in _log(order):
        try:
            event = parsed(line)
        except UNREADABLE:
            continue  # the receiver died as it wrote it
        at_s = _time(event, span.lead_s)
        if at_s < span.lead_s:
            if isinstance(event, Received) and not event.refused:
                last_words[_speaker(event)] = (line, event)
            continue
        if last_words:
            yield from last_words.values()
            last_words.clear()
        if at_s > span.until_s:
            return
        if not isinstance(event, Tick) or at_s > span.engine_s:
            yield line, event


def _log(order: Order) -> Iterator[bytes]:
    files = segments_until(order.log, order.span.until_s)
    begun = [row for row, file in enumerate(files) if begun_s(file) <= order.span.lead_s]
    for file in files[max((begun[-1] if begun else 0) - EARLIER_SEGMENTS, 0) :]:
        yield from lines_of(file)


class _Who(msgspec.Struct, gc=False):
    uuid: str = ""


_WHO = msgspec.json.Decoder(_Who)


def _speaker(event: Received) -> tuple[str | None, str, bool]:
    """Whose message it is, and whether a status."""
    try:
        uuid = _WHO.decode(event.raw).uuid
    except (msgspec.DecodeError, UnicodeDecodeError):
        uuid = ""
    return event.connection.vendor, uuid, b'"operationalState"' in event.raw


def _time(event: Event, otherwise_s: float) -> float:
    """When an event was; an end of a connection does not say."""
    if isinstance(event, Received | Overtaken):
        return event.arrival_s
    return event.now_s if isinstance(event, Tick | EngineStarted) else otherwise_s


def _line(told: dict[str, Any]) -> bytes:
    return json.dumps(told, ensure_ascii=False, separators=(",", ":")).encode() + b"\n"
