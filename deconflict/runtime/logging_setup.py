"""The service's own log on standard error: as text or as JSON lines, without secrets, and never a flood."""

import json
import logging
import os
import re
import time
from collections.abc import Callable
from typing import Any, TextIO

from ingest.languages.massrobotics import timestamps

FORMATS = ("text", "json")
VARIABLE = "DECONFLICT_LOG"
"""Tells the roles' processes, and a container, which format."""
TEXT = "%(asctime)s %(levelname)s %(name)s: %(message)s"
MOST_ALIKE, WITHIN_S = 20, 60.0
"""Of lines from one place in the program, so many in so long; how many more there were is said after it."""
CHATTY = ("websockets", "uvicorn", "httpx", "httpcore")
"""They tell of each connection or request, addresses with their queries included."""
HIDDEN = "[hidden]"

_SECRET = re.compile(
    r"(?P<kept>bearer\s+|basic\s+|://[^/\s:@]+:|(?:token|secret|password|authorization|api_?key)[\"']?\s*[=:]\s*[\"']?)"
    r"(?!env:|file:|bearer\s|basic\s)(?=\S{6})[^\s\"'&@,;)}]+",
    re.IGNORECASE,
)


def begin(kind: str) -> None:
    """Log to standard error as `kind` says, one of `FORMATS`; child processes do the same."""
    os.environ[VARIABLE] = kind
    logging.basicConfig(level=logging.INFO, handlers=[handler(kind, time.monotonic)])
    for chatty in CHATTY:
        logging.getLogger(chatty).setLevel(logging.WARNING)


def handler(kind: str, clock: Callable[[], float], stream: TextIO | None = None) -> logging.Handler:
    """Writes to the stream, standard error if none."""
    made = logging.StreamHandler(stream)
    made.setFormatter(Lines() if kind == "json" else Text(TEXT))
    made.addFilter(Bounded(clock))
    return made


def hidden(text: str) -> str:
    """The text without what looks like a secret, and without halves of characters, which no stream takes."""
    return _SECRET.sub(rf"\g<kept>{HIDDEN}", text).encode("utf-8", "backslashreplace").decode()


class Text(logging.Formatter):
    """For people."""

    def format(self, record: logging.LogRecord) -> str:
        return hidden(super().format(record))


class Lines(logging.Formatter):
    """A JSON object a line: `at`, `level`, `logger`, `said`, and `error` with its story where there is one."""

    def format(self, record: logging.LogRecord) -> str:
        told: dict[str, Any] = {
            "at": timestamps.write(record.created),
            "level": record.levelname.lower(),
            "logger": record.name,
            "process": record.process,
            "said": hidden(record.getMessage()),
        }
        if record.exc_info:
            told["error"] = hidden(self.formatException(record.exc_info))
        return json.dumps(told, ensure_ascii=False)


class Bounded(logging.Filter):
    """Lets so many lines of one place through in so long. Places are lines of the program, so they are bounded too."""

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self._seen: dict[tuple[str, int], tuple[float, int]] = {}
        """By place: since when lines are counted, and how many there were."""

    def filter(self, record: logging.LogRecord) -> bool:
        now_s, place = self._clock(), (record.pathname, record.lineno)
        since_s, count = self._seen.get(place, (now_s, 0))
        if now_s - since_s >= WITHIN_S:
            if count > MOST_ALIKE:
                said = f"{record.getMessage()} ({count - MOST_ALIKE} like this were left out)"
                record.msg, record.args = said, None
            since_s, count = now_s, 0
        self._seen[place] = since_s, count + 1
        return count < MOST_ALIKE
