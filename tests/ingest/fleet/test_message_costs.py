"""What the most expensive messages cost, counted in calls: the time of a test machine says little."""

import json
import sys
from collections.abc import Iterator
from types import FrameType
from typing import Any

import pytest

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.helpers.saying import points, status

NOW_S = 1_790_000_000.0
MOST_CALLS_A_BYTE = 2.0
STATUS: dict[str, Any] = json.loads(status("A-1", NOW_S, 1.0, 2.0))
(POINT,) = points((NOW_S + 1.0, 1.0, 2.0, 0.0))


def expensive() -> Iterator[tuple[str, dict[str, Any]]]:
    yield "error codes", {"errorCodes": ["a"] * 14_000}
    yield "different error codes", {"errorCodes": [f"{number}" for number in range(8000)]}
    yield "numbers for error codes", {"errorCodes": [1] * 20_000}
    yield "unknown arrays", {"x": [[]] * 14_000}
    yield "unknown keys", {f"k{number}": 0 for number in range(5500)}
    yield "empty points", {"path": [{}] * 14_000}
    yield "points of another type", {"path": [{"x": []}] * 6000}
    yield "unusable points", {"path": [POINT | {"timestamp": "x"}] * 400}


def spelt_otherwise() -> Iterator[tuple[str, bytes]]:
    yield "signs", b'"x": [' + b"+1, " * 20_000 + b"1]"
    yield "different signs", b'"x": [' + b"".join(b"+%d," % number for number in range(15_000)) + b"1]"
    yield "commas at the end", b'"x": [' + b"[1,]," * 16_000 + b"]"
    yield "tabs", b'"x": [' + b'"\t",' * 16_000 + b'""]'
    yield "keys", b'"x": {' + b",".join(b'"%d":.5' % number for number in range(8000)) + b"}"
    yield "a long key", b'"' + b"k" * 40_000 + b'": [' + b"+1, " * 10_000 + b"1]"


@pytest.mark.parametrize(("keys"), [keys for _, keys in expensive()], ids=[name for name, _ in expensive()])
def test_no_long_message_takes_more_than_a_few_calls_a_byte(keys: dict[str, Any]) -> None:
    assert calls_of(json.dumps(STATUS | keys).encode()) < MOST_CALLS_A_BYTE


@pytest.mark.parametrize("part", [part for _, part in spelt_otherwise()], ids=[name for name, _ in spelt_otherwise()])
def test_no_long_message_that_is_not_quite_json_takes_more_than_a_few_calls_a_byte(part: bytes) -> None:
    assert calls_of(json.dumps(STATUS).encode()[:-1] + b", " + part + b"}") < 1.5 * MOST_CALLS_A_BYTE


def calls_of(raw: bytes) -> float:
    """Calls for each byte of a message, which is accepted."""
    fleet, connection = fleet_of(Site(), Measures()), Connection(1, vendor="Alder")
    fleet.receive(status("A-1", NOW_S - 1.0, 1.0, 2.0), NOW_S - 1.0, connection)
    calls = 0

    def count(_: FrameType, event: str, __: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        rejected = fleet.receive(raw, NOW_S, connection)
    finally:
        sys.setprofile(None)
    assert rejected is None
    return calls / len(raw)
