"""The first line of a black box: the site, and the engine's state from which a replay resumes."""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deconflict.runtime.learned_state import Part, UnreadableError, unpacked
from deconflict.settings.site import Site
from deconflict_client.advisory import ADVISORY, AnyAdvisory
from ingest.recording.compression import DAMAGED
from ingest.recording.log_reader import lines_of

FORMAT = 2
OLDEST_FORMAT = 1
"""Of it, a box that begins while an engine runs lacks the time before."""
_TORN = (OSError, *DAMAGED)


class BoxError(ValueError):
    """The black box can't be read; the message says why."""


@dataclass(frozen=True, slots=True)
class StartState:
    """The state from which an engine resumes."""

    open: tuple[AnyAdvisory, ...] = ()
    encounters: dict[tuple[str, str], int] = field(default_factory=dict)
    """Number of encounters of each pair so far."""
    burdens_s: dict[str, float] = field(default_factory=dict)
    """How long each vendor's robots have yielded."""
    learned: Mapping[str, Part] | None = None
    under_way: Mapping[str, Part] = field(default_factory=dict)
    """What a running engine had under way, which an engine takes over that has made the same passes."""
    resumed_s: float | None = None
    """The pass at which a running engine had this state; None if an engine started with it."""


def head_of(file: Path) -> dict[str, Any] | None:
    """The head of a black box; None if the file is another log. Raises `BoxError`."""
    try:
        first = next(lines_of(file), b"") if file.is_file() else b""
        document = json.loads(first)
    except (*_TORN, ValueError, RecursionError):
        return None
    if not isinstance(document, dict) or not isinstance(head := document.get("blackbox"), dict):
        return None
    if head.get("format") not in range(OLDEST_FORMAT, FORMAT + 1):
        raise BoxError(f"{file} has format {head.get('format')} and this release reads up to format {FORMAT}")
    return head


def site_of(head: Mapping[str, Any]) -> Site:
    """The site as it was, without secrets. Raises `BoxError`."""
    try:
        return Site.model_validate_json(json.dumps(head["site"]))
    except (KeyError, ValueError, RecursionError) as error:
        raise BoxError(f"this release can't read the site in the black box: {error}") from error


def start_of(head: Mapping[str, Any]) -> StartState:
    """The state of the engine. Raises `BoxError`."""
    try:
        resumed_s = head.get("resumed_s")
        return StartState(
            tuple(ADVISORY.validate_python(advisory) for advisory in head["open"]),
            {(a, b): int(count) for a, b, count in head["encounters"]},
            {str(vendor): float(yielded_s) for vendor, yielded_s in head["burdens_s"].items()},
            _parts(head["learned"]) or None,
            _parts(head.get("under_way")),
            None if resumed_s is None else float(resumed_s),
        )
    except (KeyError, TypeError, ValueError, AttributeError, UnreadableError) as error:
        raise BoxError(f"the black box lacks the state of the engine: {error}") from error


def _parts(text: str | None) -> dict[str, Part]:
    """The parts that are written as this text."""
    return unpacked(base64.b64decode(text, validate=True)) if text else {}
