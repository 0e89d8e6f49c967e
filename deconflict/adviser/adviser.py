"""The adviser in one process: reports in, requests out."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

from deconflict.adviser.request import Request
from deconflict.adviser.standoff_advice import StandoffAdvice
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.settings import site_file
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import DEFAULT, Site
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received

PEER = "adviser"
"""Address that all messages count as coming from: who may send was decided before."""


class Adviser:
    """Hears identity and status reports, and asks robots for what helps them all."""

    def __init__(self, site: Site | Path | str | None = None) -> None:
        """`site` is a site, or the path of a site file. Without any, each datum is a floor of its own."""
        settings = DEFAULT if site is None else site if isinstance(site, Site) else site_file.load(Path(site))
        self._fleet = fleet_of(settings, Measures())
        self._robots = RobotTable(PlaceGeometry(settings.resources, settings.zones))
        self._advice = StandoffAdvice(vendor.name for vendor in settings.vendors if vendor.participant == "person")
        self._now_s = 0.0
        self._makers: dict[str, str] = {}
        """By UUID, what its newest identity report says."""

    def hear(self, now_s: float, messages: Iterable[Mapping[str, Any]]) -> list[Request]:
        """Requests that are new, changed or withdrawn since the last call.

        `messages` are reports of the MassRobotics standard that arrived by `now_s`, seconds since the epoch.
        """
        for message in messages:
            uuid = str(message.get("uuid", ""))
            if "manufacturerName" in message:
                self._makers[uuid] = str(message["manufacturerName"])
            maker = self._makers.get(uuid)
            connection = Connection(1, PEER, f"/{maker or ''}", maker)
            self._fleet.receive_recorded(Received(json.dumps(message).encode(), now_s, connection))
        batch = self._fleet.next_batch(now_s)
        self._robots.forget(batch.gone)
        self._robots.update(batch)
        self._advice.receive(batch, self._robots)
        self._now_s = now_s
        return self._advice.step(self._robots, now_s)

    def answer(self, request_id: str, answer: Literal["accepted", "declined", "done"], why: str = "") -> None:
        """What a robot answered to a request."""
        self._advice.answer(request_id, answer, why, self._robots, self._now_s)
