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


@pytest.mark.parametrize(("keys"), [keys for _, keys in expensive()], ids=[name for name, _ in expensive()])
def test_no_long_message_takes_more_than_a_few_calls_a_byte(keys: dict[str, Any]) -> None:
    fleet, connection = fleet_of(Site(), Measures()), Connection(1, vendor="Alder")
    fleet.receive(status("A-1", NOW_S - 1.0, 1.0, 2.0), NOW_S - 1.0, connection)
    raw, calls = json.dumps(STATUS | keys).encode(), 0

    def count(_: FrameType, event: str, __: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        fleet.receive(raw, NOW_S, connection)
    finally:
        sys.setprofile(None)
    assert calls < MOST_CALLS_A_BYTE * len(raw)
