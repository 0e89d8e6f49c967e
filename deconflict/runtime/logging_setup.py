"""The service's own log on standard error: text or JSON lines, without secrets, with a limit on repeated lines."""

import json
import logging
import os
import re
import time
from collections.abc import Callable
from textwrap import indent
from typing import Any, TextIO

from ingest.languages import timestamps
from ingest.languages.visible_text import visible, visible_lines

FORMATS = ("text", "json")
VARIABLE = "DECONFLICT_LOG"
"""Environment variable that gives the format to the processes of the roles, and to a container."""
TEXT = "%(asctime)s %(levelname)s %(name)s: %(message)s"
MOST_ALIKE, WITHIN_S = 20, 60.0
"""Each line of the program logs at most this many records in this many seconds. The next record says how many were left
out."""
CHATTY = ("websockets", "uvicorn", "httpx", "httpcore")
"""Loggers that log each connection or request, and write out addresses with their queries."""
HIDDEN = "[hidden]"

_SECRET = re.compile(
    r"(?P<kept>bearer\s+|basic\s+|://[^/\s:@]+:(?=[^/\s@]+@)|(?:token|secret|password|authorization|api_?key)[\"']?\s*[=:]\s*[\"']?)"
    r"(?!env:|file:|bearer\s|basic\s)(?=\S{6})[^\s\"'&@,;)}]+",
    re.IGNORECASE,
)


def begin(kind: str) -> None:
    """Log to standard error in the format `kind`, one of `FORMATS`. Child processes do the same."""
    os.environ[VARIABLE] = kind
    logging.basicConfig(level=logging.INFO, handlers=[create_handler(kind, time.monotonic)])
    for chatty in CHATTY:
        logging.getLogger(chatty).setLevel(logging.WARNING)


def create_handler(kind: str, clock: Callable[[], float], stream: TextIO | None = None) -> logging.Handler:
    """A handler that writes to `stream`, or to standard error if `stream` is None."""
    handler = logging.StreamHandler(stream)
    handler.setFormatter(JsonFormatter() if kind == "json" else TextFormatter(TEXT))
    handler.addFilter(RepeatLimit(clock))
    return handler


def hidden(text: str) -> str:
    """The text without anything that looks like a secret, and without lone surrogates, which no stream can encode."""
    return _SECRET.sub(rf"\g<kept>{HIDDEN}", text).encode("utf-8", "backslashreplace").decode()


class TextFormatter(logging.Formatter):
    """Lines for people: each record on one line, and a traceback on indented ones."""

    def format(self, record: logging.LogRecord) -> str:
        return hidden(super().format(record))

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - named by logging
        record.message = visible(record.message)
        return super().formatMessage(record)

    def formatException(self, ei: Any) -> str:  # noqa: N802 - named by logging
        return indent(visible_lines(super().formatException(ei)), "    ")


class JsonFormatter(logging.Formatter):
    """One JSON object a line: `at`, `level`, `logger`, `process`, `said`, and `error` with the traceback if any."""

    def format(self, record: logging.LogRecord) -> str:
        document: dict[str, Any] = {
            "at": timestamps.write(record.created),
            "level": record.levelname.lower(),
            "logger": record.name,
            "process": record.process,
            "said": hidden(record.getMessage()),
        }
        if record.exc_info:
            document["error"] = hidden(self.formatException(record.exc_info))
        return json.dumps(document)


class RepeatLimit(logging.Filter):
    """Lets at most `MOST_ALIKE` records of one place through in `WITHIN_S`.

    A place is a line of the program, so the number of places is bounded.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self._seen: dict[tuple[str, int], tuple[float, int]] = {}
        """By place: when its count began, and the number of records since."""

    def filter(self, record: logging.LogRecord) -> bool:
        now_s, place = self._clock(), (record.pathname, record.lineno)
        since_s, count = self._seen.get(place, (now_s, 0))
        if now_s - since_s >= WITHIN_S:
            if count > MOST_ALIKE:
                text = f"{record.getMessage()} ({count - MOST_ALIKE} like this were left out)"
                record.msg, record.args = text, None
            since_s, count = now_s, 0
        self._seen[place] = since_s, count + 1
        return count < MOST_ALIKE
