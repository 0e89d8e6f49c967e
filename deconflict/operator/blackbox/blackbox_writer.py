"""Writes one black box from the recording. `deconflict replay FILE` gives the advisories that the service published.

    {"before": HASH, "blackbox": {"site": {...}, "near_misses": [...], "learned": ..., ...}}
    {"before": HASH, "received": ...}      as in the log: messages, ticks, ends of connections
    {"before": HASH, "decided": "...Z", "advisory": {...}}
    {"before": HASH, "end": LINES}

The last messages of each robot before the lead come first, so that no quiet robot and no identity is missing.
"""

import base64
import json
import logging
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import zstandard

from deconflict.operator.blackbox.archive import Archive, Box
from deconflict.operator.blackbox.blackbox_request import BlackBoxRequest, BoxSpan
from deconflict.operator.blackbox.hash_chain import HashChain
from deconflict.operator.blackbox.hindsight import recorded_tracks
from deconflict.operator.blackbox.near_misses import NearMiss, one_for_each_event, verified_near_miss
from deconflict.operator.blackbox.start_state import FORMAT
from deconflict.operator.store.pending_writes import PendingWrites, open_at_time
from deconflict.operator.store.tables import between, open_at, read_only
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory
from deconflict_client.situations import REVISION, advisories_of
from ingest.fleet.owners.owner_file import kept_marks
from ingest.fleet.recovery.kept_messages import kept_identities
from ingest.languages import timestamps
from ingest.languages.front_ends import FRONT_ENDS
from ingest.plain_files import check_database
from ingest.recording.compression import DAMAGED
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
from ingest.recording.recorder import line_of, mark_line
from ingest.recording.replaced_file import replacing

log = logging.getLogger(__name__)

OMITTED_SECTIONS = {"operator", "receiver", "webhooks", "mqtt", "mqtt_sources", "store", "recorder", "blackbox"}
"""Sections of the site that a replay does not need."""
OMITTED_VENDOR_KEYS = {"token", "certificate_names", "dial"}
"""Keys of a vendor that a replay does not need, and that may hold secrets."""
_LastMessages = dict[tuple[str | None, str, bool], tuple[bytes, Event]]
"""By sender."""
EARLIER_SEGMENTS = 1
"""Number of log segments before the lead that are searched for the last messages of quiet robots."""


class PublishedAdvisories(NamedTuple):
    """The advisories that were open at the start of a black box, and those that were published in its time."""

    open: list[AnyAdvisory]
    """Those open when the engine of the span starts."""
    decided: list[AnyAdvisory]
    """Every revision from then until the end of the span, in order."""


def published_in(store: Path, pending: PendingWrites, span: BoxSpan) -> PublishedAdvisories:
    """The revisions of advisories in the database and in `pending`, each once: pending ones may be stored by now.

    Raises `sqlite3.Error`.
    """
    check_database(store)
    with read_only(store) as db:
        stored_open = advisories_of(open_at(db, span.engine_s))
        stored = advisories_of(between(db, span.engine_s, span.until_s))
    last = stored[-1].seq if stored else 0
    unstored = [
        revision
        for revision in advisories_of(pending)
        if revision.seq > last and span.engine_s < revision.updated_at.timestamp() <= span.until_s
    ]
    return PublishedAdvisories(open_at_time(stored_open, advisories_of(pending), span.engine_s), [*stored, *unstored])


def write_blackbox(request: BlackBoxRequest) -> Box | None:
    """Write the file and register it; None if by the robots' reports no pair came within the clearance, or
    all that did are known.

    Reads the log three times, line by line. Raises `OSError`.
    """
    identities = [each for each in kept_identities(request.log) if each.arrival_s < request.span.lead_s]
    pending = [REVISION.validate_json(text) for text in request.pending]
    published = published_in(request.store, pending, request.span)
    misses = _near_misses(request, identities, [*published.open, *published.decided])
    if not misses:
        return None
    archive = Archive(request.archive)
    chain = HashChain(archive.head())
    name = f"blackbox-{datetime.fromtimestamp(misses[0].event.began_s, UTC):%Y%m%dT%H%M%S%f}"[:-3] + "Z.jsonl.zst"
    path = request.archive / name
    with (
        replacing(path) as file,
        zstandard.ZstdCompressor().stream_writer(file, closefd=False) as compressed,
    ):
        for line in _lines(request, identities, published, misses):
            compressed.write(chain.link(line))
        compressed.write(chain.end())
    box: Box = {
        "file": name,
        "bytes": path.stat().st_size,
        "sha256": chain.head,
        "from": timestamps.write(request.span.from_s),
        "until": timestamps.write(request.span.until_s),
        "near_misses": [miss.document() for miss in misses],
    }
    archive.add(box)
    return box


def _near_misses(
    request: BlackBoxRequest, identities: Sequence[Received], published: list[AnyAdvisory]
) -> list[NearMiss]:
    """The near misses by the robots' own reports, one for each event, ordered by time."""
    robots = {uuid for pair in request.pairs for uuid in (pair.a, pair.b)}
    tracks, floors = recorded_tracks(request.site, _messages_of(request, identities, robots), robots)
    conflicts = [advisory for advisory in published if isinstance(advisory, ConflictAdvisory)]
    verified = (
        verified_near_miss(pair, tracks, floors, request.site, conflicts, request.span.until_s)
        for pair in request.pairs
    )
    return one_for_each_event(filter(None, verified), request.known)


def _messages_of(request: BlackBoxRequest, identities: Sequence[Received], robots: set[str]) -> Iterator[Received]:
    """The messages of some robots, and those of vendors whose messages name a robot in another way."""
    known = [uuid.encode() for uuid in robots]
    by_name = {vendor.name for vendor in request.site.vendors if vendor.names_as_uuid}
    for _, event in _events(request, identities):
        if isinstance(event, Received) and not event.refused:
            raw = event.raw.lower()
            sender = FRONT_ENDS[event.connection.language].sender(event.connection.topic)
            is_theirs = sender.uuid in robots if sender else any(uuid in raw for uuid in known)
            if event.connection.vendor in by_name or is_theirs:
                yield event


def _lines(
    request: BlackBoxRequest, identities: Sequence[Received], published: PublishedAdvisories, misses: list[NearMiss]
) -> Iterator[bytes]:
    """Every line except the last, without hashes."""
    yield _line({"blackbox": _head(request, published, misses)})
    pending = [(advisory.updated_at.timestamp(), advisory) for advisory in reversed(published.decided)]
    for line, event in _events(request, identities):
        while pending and pending[-1][0] < _time(event, request.span.lead_s):
            yield _decision_line(*pending.pop())
        yield line
    for at_s, advisory in reversed(pending):
        yield _decision_line(at_s, advisory)


def _head(request: BlackBoxRequest, published: PublishedAdvisories, misses: list[NearMiss]) -> dict[str, Any]:
    span, snapshot = request.span, request.snapshot
    restarts = [event for _, event in _events(request, ()) if isinstance(event, EngineStarted)]
    return {
        "format": FORMAT,
        "site": _site(request.site),
        "from": timestamps.write(span.from_s),
        "until": timestamps.write(span.until_s),
        "resumed_s": snapshot.at_s if _was_running(request) and snapshot else None,
        "engine_restarts": sum(restart.now_s > span.engine_s + 1.0 for restart in restarts),
        "near_misses": [miss.document() for miss in misses],
        "open": [advisory.model_dump(mode="json") for advisory in published.open],
        "encounters": _encounters(published),
        "burdens_s": snapshot.burdens_s if snapshot else {},
        "learned": _text(snapshot.learned) if snapshot else None,
        "under_way": _text(snapshot.under_way) if snapshot else None,
    }


def _text(packed: bytes) -> str:
    return base64.b64encode(packed).decode()


def _site(site: Site) -> dict[str, Any]:
    """The settings that a replay needs, without anything that could be a secret."""
    document = site.model_dump(mode="json", exclude=OMITTED_SECTIONS)
    for vendor in document["vendors"]:
        for key in OMITTED_VENDOR_KEYS:
            del vendor[key]
    return document


def _encounters(published: PublishedAdvisories) -> list[list[Any]]:
    """The number of encounters that each pair in the decisions had when the engine started."""
    counts: dict[tuple[str, str], int] = {}
    for advisory in (*published.open, *published.decided):
        if isinstance(advisory, ConflictAdvisory):
            is_new = advisory.state is AdvisoryState.RAISED
            counts.setdefault(advisory.robots, advisory.encounter - is_new)
    return [[*pair, count] for pair, count in sorted(counts.items())]


def _events(request: BlackBoxRequest, identities: Sequence[Received]) -> Iterator[tuple[bytes, Event]]:
    """The lines of the log that the box holds, in order, each with its event. First come the last messages before the
    lead, including the identity reports that were kept beside the log."""
    span = request.span
    ticks_s = span.lead_s if _was_running(request) else span.engine_s
    before = {False: _LastMessages(), True: _LastMessages()}
    for identity in identities:
        before[bool(identity.connection.topic)][_sender(identity)] = line_of(identity), identity
    marks = kept_marks(request.log)
    yield from ((mark_line(mark), mark) for mark in marks if mark.at_s < span.lead_s)
    for line in _log_lines(request):
        try:
            event = parsed(line)
        except UNREADABLE:
            continue  # the receiver was killed while it wrote the line
        at_s, on_topic = _time(event, span.lead_s), isinstance(event, Received) and bool(event.connection.topic)
        if at_s < (span.paced_s if on_topic else span.lead_s):
            if isinstance(event, Received) and not event.refused:
                before[on_topic][_sender(event)] = line, event
            continue
        for last_messages in (before[True], before[False]) if at_s >= span.lead_s else (before[True],):
            yield from last_messages.values()
            last_messages.clear()
        if at_s > span.until_s:
            return
        if not isinstance(event, Tick) or at_s > ticks_s:
            yield line, event


def _was_running(request: BlackBoxRequest) -> bool:
    """Whether the box begins while an engine runs."""
    return request.snapshot is not None and not request.snapshot.is_start


def _log_lines(request: BlackBoxRequest) -> Iterator[bytes]:
    files = segments_until(request.log, request.span.until_s)
    before_lead = bisect_right(files, request.span.paced_s, key=begun_s)
    for file in files[max(before_lead - 1 - EARLIER_SEGMENTS, 0) :]:
        try:
            yield from lines_of(file)
        except DAMAGED as error:
            log.warning("%s is damaged; a black box has what can be read of it: %s", file, error)


class _MessageUuid(msgspec.Struct, gc=False):
    uuid: str = ""


_UUID_DECODER = msgspec.json.Decoder(_MessageUuid)


def _sender(event: Received) -> tuple[str | None, str, bool]:
    """The vendor of a message, its robot or its topic, and whether it is a status."""
    connection = event.connection
    if connection.topic:
        return connection.vendor, connection.topic, True
    try:
        uuid = _UUID_DECODER.decode(event.raw).uuid
    except (msgspec.DecodeError, UnicodeDecodeError):
        uuid = ""
    return connection.vendor, uuid, FRONT_ENDS[connection.language].has_pose(event.raw, connection.topic)


def _time(event: Event, default_s: float) -> float:
    """The time of an event; `default_s` for the end of a connection, which has none."""
    if isinstance(event, Received | Overtaken):
        return event.arrival_s
    return event.now_s if isinstance(event, Tick | EngineStarted) else default_s


def _decision_line(at_s: float, advisory: AnyAdvisory) -> bytes:
    return _line({"decided": timestamps.write(at_s), "advisory": advisory.model_dump(mode="json")})


def _line(document: dict[str, Any]) -> bytes:
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode() + b"\n"
