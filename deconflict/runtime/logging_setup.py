"""The service's own log on standard error: text or JSON lines, without secrets, with a limit on repeated lines."""

import json
import logging
import os
import re
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from textwrap import indent
from typing import Any, TextIO

from deconflict_client.counted_nouns import count_of
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
WAIT_S = 0.2
"""So long a line waits to be written. Once one was not, none waits until the reader reads again."""
MOST_UNREAD_BYTES = 1 << 20
"""Lines that wait for the reader of standard error. Further ones are left out and counted."""

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
    handler: logging.Handler = logging.StreamHandler(stream or _standard_error())
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


class UnhurriedOutput:
    """Standard error whose reader may stop reading, as a collector of logs that hangs. Nobody waits for it for long.

    A thread writes the text, and ends when there is none, so that a fork finds no other thread.
    """

    def __init__(self, descriptor: int, most_bytes: int = MOST_UNREAD_BYTES) -> None:
        self._descriptor, self._most_bytes = descriptor, most_bytes
        self._begin()
        os.register_at_fork(after_in_child=self._begin)

    def _begin(self) -> None:
        """Begin with nothing, also in a forked process: what waits is written by the one that it was forked from."""
        self._waiting: deque[bytes] = deque()
        self._bytes = self._left_out = 0
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_stuck = False

    def write(self, text: str) -> None:
        """Write the text soon. Returns once it is written, or after `WAIT_S`."""
        data = text.encode("utf-8", "backslashreplace")
        with self._changed:
            if self._bytes + len(data) > self._most_bytes:
                self._left_out += 1
                return
            self._add(data)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="log", daemon=True)
                self._thread.start()
            if not self._is_stuck:
                self._is_stuck = not self._changed.wait_for(lambda: self._thread is None, WAIT_S)

    def _add(self, data: bytes) -> None:
        self._waiting.append(data)
        self._bytes += len(data)

    def _run(self) -> None:
        while data := self._next():
            with suppress(OSError):  # nobody will read it
                self._write_all(data)

    def _next(self) -> bytes | None:
        """The next text; None if there is no more, and then this thread ends."""
        with self._changed:
            if not self._waiting and self._left_out:
                lines = count_of(self._left_out, "line of the log was", "lines of the log were")
                self._add(f"{lines} left out: nobody read standard error\n".encode())
                self._left_out = 0
            if self._waiting:
                self._bytes -= len(self._waiting[0])
                return self._waiting.popleft()
            self._thread, self._is_stuck = None, False
            self._changed.notify_all()
            return None

    def _write_all(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._descriptor, data) :]


def _standard_error() -> UnhurriedOutput | None:
    """None if this process has none, or another program of Python has replaced it."""
    try:
        return UnhurriedOutput(sys.stderr.fileno())
    except (AttributeError, OSError, ValueError):
        return None
