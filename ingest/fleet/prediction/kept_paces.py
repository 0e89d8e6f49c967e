"""How fast robots were seen to drive, for a black box: a fleet that reads the messages after that goes on with it."""

from collections.abc import Iterable
from math import isfinite

import msgspec

from ingest.fleet.prediction.forecast_model import Knot, Sighting
from ingest.fleet.prediction.pace import BEYOND, CORNER, TURN, Kind, ObservedSpeeds, Pace, PaceBook, SpeedsByKind


class KeptSpeeds(msgspec.Struct):
    """Speeds on ways of one kind."""

    kind: str
    seen_s: float
    samples: list[tuple[float, float]]


class KeptPace(msgspec.Struct):
    """What was seen of one robot."""

    own: list[KeptSpeeds]
    kind: str | None
    since: Sighting | None
    beyond_corner: tuple[float, float, float] | None
    beyond_path: tuple[Knot, float, float] | None


class KeptPaces(msgspec.Struct):
    """What was seen of robots, by UUID, and of each model of each vendor."""

    robots: dict[str, KeptPace] = {}
    models: list[tuple[str, str, list[KeptSpeeds]]] = []


PACES = msgspec.json.Decoder(KeptPaces)


def kept_paces(book: PaceBook, robots: Iterable[tuple[str, Pace]]) -> KeptPaces:
    """What was seen by now."""
    models = [(vendor, model, _kept(speeds)) for (vendor, model), speeds in book.models.items()]
    return KeptPaces({uuid: _kept_pace(pace) for uuid, pace in robots}, models)


def take_over(kept: KeptPaces, book: PaceBook) -> None:
    """Go on with what was seen. Robots get theirs when they are first heard. Raises `ValueError`."""
    for vendor, model, speeds in kept.models:
        book.of_model(vendor, model).update(_speeds(speeds, of_model=True))
    for uuid, pace in kept.robots.items():
        own = _speeds(pace.own, of_model=False)
        kind = None if pace.kind is None else _kind(pace.kind)
        book.seen_before[uuid] = Pace.of(own, kind, pace.since, pace.beyond_corner, pace.beyond_path)


def _kept_pace(pace: Pace) -> KeptPace:
    since, beyond_corner, beyond_path = pace.awaited
    known = since if since and isfinite(since.yaw_rad) else None
    return KeptPace(_kept(pace.own), None if pace.kind is None else str(pace.kind), known, beyond_corner, beyond_path)


def _kept(by_kind: SpeedsByKind) -> list[KeptSpeeds]:
    return [KeptSpeeds(str(kind), speeds.seen_s, list(speeds.samples)) for kind, speeds in by_kind.items()]


def _speeds(kept: Iterable[KeptSpeeds], *, of_model: bool) -> SpeedsByKind:
    kinds = [(_kind(each.kind), each) for each in kept if each.samples]
    return {kind: ObservedSpeeds.of(kind, each.samples, each.seen_s, of_model=of_model) for kind, each in kinds}


def _kind(text: str) -> Kind:
    return text if text in (TURN, CORNER, BEYOND) else float(text)
