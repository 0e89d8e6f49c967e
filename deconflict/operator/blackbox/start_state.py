"""How a black box begins: the site, and what the engine had in mind, so that another goes on in its place."""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zstandard
from pydantic import ValidationError

from deconflict.advisory import ADVISORY, AnyAdvisory
from deconflict.runtime.learned_state import Part, UnreadableError, unpacked
from deconflict.settings.site import Site
from ingest.recording.log_reader import lines_of

FORMAT = 1
_TORN = (OSError, EOFError, zstandard.ZstdError)


class BoxError(ValueError):
    """A black box that can't be read; the message says why."""


@dataclass(frozen=True, slots=True)
class Start:
    """What an engine goes on with."""

    open: tuple[AnyAdvisory, ...] = ()
    encounters: dict[tuple[str, str], int] = field(default_factory=dict)
    """How many each pair has had."""
    burdens_s: dict[str, float] = field(default_factory=dict)
    learned: Mapping[str, Part] | None = None


def head_of(file: Path) -> dict[str, Any] | None:
    """What a black box says of itself; None of any other log. Raises `BoxError`."""
    try:
        first = next(lines_of(file), b"") if file.is_file() else b""
        told = json.loads(first)
    except (*_TORN, ValueError):
        return None
    if not isinstance(told, dict) or not isinstance(head := told.get("blackbox"), dict):
        return None
    if head.get("format") != FORMAT:
        raise BoxError(f"{file} has format {head.get('format')} and this release reads format {FORMAT}")
    return head


def site_of(head: Mapping[str, Any]) -> Site:
    """The site as it was, without what is secret. Raises `BoxError`."""
    try:
        return Site.model_validate_json(json.dumps(head["site"]))
    except (KeyError, ValidationError) as error:
        raise BoxError(f"the black box tells of no site that this release reads: {error}") from error


def start_of(head: Mapping[str, Any]) -> Start:
    """What the engine had in mind. Raises `BoxError`."""
    try:
        learned = base64.b64decode(head["learned"] or "", validate=True)
        return Start(
            tuple(ADVISORY.validate_python(one) for one in head["open"]),
            {(a, b): int(count) for a, b, count in head["encounters"]},
            {str(vendor): float(yielded_s) for vendor, yielded_s in head["burdens_s"].items()},
            unpacked(learned) if learned else None,
        )
    except (KeyError, TypeError, ValueError, AttributeError, UnreadableError) as error:
        raise BoxError(f"the black box does not tell what the engine had in mind: {error}") from error
