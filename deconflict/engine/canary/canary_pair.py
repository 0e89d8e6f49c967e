"""The canary: every few seconds two made-up robots meet, to see that a warning still comes through the whole service.

The receiver reads their messages, the engine predicts the conflict, and the operator face stores the advisory, each
between its other work. The robots are in a fleet and an engine of their own, so no stream, count, recording or replay
has them.
"""

import asyncio
import json
import time
from collections.abc import Callable

from deconflict.engine.canary.canary_parcel import Canary
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.languages import timestamps
from ingest.measures.measures import Measures
from ingest.port.connection import Connection

CANARY_EVERY_S = 5.0
FLOOR = "ca9a7700-0000-4000-8000-000000000000"
ROBOTS = {"ca9a7700-0000-4000-8000-000000000001": (-4.0, 1.0), "ca9a7700-0000-4000-8000-000000000002": (4.0, -1.0)}
"""Where each is on the x axis, m, and how fast it drives, m/s."""


class CanaryPair:
    """Makes a canary every few seconds. One that nobody takes stays the newest: its age is the delay."""

    def __init__(self, wall: Callable[[], float]) -> None:
        self._wall = wall
        self._waiting: Canary | None = None

    async def run(self) -> None:
        """Until cancelled."""
        due_s = time.monotonic()
        while True:
            self._waiting = self._waiting or Canary(due_s, canary_batch(self._wall()))
            due_s = max(due_s + CANARY_EVERY_S, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())

    def take(self) -> Canary | None:
        taken, self._waiting = self._waiting, None
        return taken


def canary_batch(now_s: float) -> bytes:
    fleet, connection = fleet_of(Site(), Measures()), Connection(0)
    for uuid in ROBOTS:
        fleet.receive(_status(uuid, now_s), now_s, connection)
    return fleet.next_batch(now_s, everything=True).to_bytes()


def _status(uuid: str, now_s: float) -> bytes:
    x_m, speed_mps = ROBOTS[uuid]
    places = [
        {
            "timestamp": timestamps.write(now_s + ahead_s),
            "x": x_m + ahead_s * speed_mps,
            "y": 0.0,
            "angle": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            "planarDatum": FLOOR,
        }
        for ahead_s in range(9)
    ]
    path = [{"planarDatumUUID": FLOOR, **place} for place in places[1:]]
    return json.dumps(
        {
            "uuid": uuid,
            "timestamp": timestamps.write(now_s),
            "operationalState": "navigating",
            "location": places[0],
            "path": path,
        }
    ).encode()
