"""The adviser in one process: reports in, requests out."""

import json
from collections.abc import Iterable, Mapping
from itertools import count
from math import isfinite
from pathlib import Path
from typing import Any, get_args

from deconflict.adviser.asked import Request
from deconflict.adviser.standoff_advice import StandoffAdvice
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.settings import site_file
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import DEFAULT, Site
from deconflict.sweep.robot_slots import RobotSlots
from deconflict_client.advisory import AdviceAnswer
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received

PEER = "adviser"
"""Address that all messages count as coming from: who may send was decided before."""

BACK_S = 5.0
"""A clock that goes back by no more stands still meanwhile."""


class Adviser:
    """Hears identity and status reports, and asks robots for what helps them all."""

    def __init__(self, site: Site | Path | str | None = None) -> None:
        """`site` is a site, or the path of a site file. Without any, each datum is a floor of its own."""
        settings = DEFAULT if site is None else site if isinstance(site, Site) else site_file.load(Path(site))
        self._settings = settings
        self._numbers, self._now_s = count(1), 0.0
        self.refused = 0
        """Messages that were no reports, or not accepted."""
        self._identities: dict[str, Mapping[str, Any]] = {}
        """By UUID, the newest identity report."""
        self._begin()

    def hear(self, now_s: float, messages: Iterable[Mapping[str, Any]]) -> list[Request]:
        """Requests that are new, changed or withdrawn since the last call.

        `messages` are reports of the MassRobotics standard that arrived by `now_s`, seconds since the epoch. What is
        no report is counted in `refused`. If the time goes back by more than `BACK_S`, all requests are withdrawn,
        and all but identity reports is forgotten. Raises ValueError if `now_s` is not finite.
        """
        if not isfinite(now_s):
            raise ValueError(f"now_s is {now_s}: give the time in seconds since the epoch")
        withdrawn = []
        if now_s < self._now_s - BACK_S:
            withdrawn = self._advice.end_all()
            self._begin()
            messages, self._now_s = [*self._identities.values(), *messages], now_s
        self._now_s = now_s = max(now_s, self._now_s)
        for message in messages:
            self._receive(message, now_s)
        batch = self._fleet.next_batch(now_s)
        self._robots.forget(batch.gone)
        self._robots.slots.release(batch.gone)
        for uuid in batch.gone:
            self._identities.pop(uuid, None)
        self._robots.update(batch)
        self._advice.receive(batch, self._robots)
        return withdrawn + self._advice.step(self._robots, now_s)

    def answer(self, request_id: str, answer: AdviceAnswer, why: str = "") -> None:
        """What a robot answered to a request. Raises ValueError for another word."""
        if answer not in get_args(AdviceAnswer):
            raise ValueError(f"a robot answers accepted, declined or done, and not {answer!r}")
        self._advice.answer(str(request_id), answer, str(why or ""), self._robots, self._now_s)

    def _begin(self) -> None:
        measures = Measures()
        self._fleet = fleet_of(self._settings, measures)
        geometry = PlaceGeometry(self._settings.resources, self._settings.zones)
        self._robots = RobotTable(geometry, RobotSlots())
        self._advice = StandoffAdvice(self._settings, measures, self._numbers)

    def _receive(self, message: Mapping[str, Any], now_s: float) -> None:
        try:
            raw, uuid = json.dumps(message).encode(), str(message.get("uuid", "")).lower()
        except (AttributeError, TypeError, ValueError, RecursionError):
            self.refused += 1
            return
        named = message.get("manufacturerName")
        maker = named if isinstance(named, str) else self._identities.get(uuid, {}).get("manufacturerName")
        connection = Connection(1, PEER, f"/{maker or ''}", maker)
        if self._fleet.receive_recorded(Received(raw, now_s, connection)):
            self.refused += 1
        elif isinstance(named, str):
            self._identities[uuid] = message
