"""The demo's floor with a simulated clock: the messages of its robots, and what truly happens to them."""

from bisect import insort
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.watch_demo.true_encounters import SAME_ENCOUNTER_S, TrueEncounter, near_pairs
from benchmarks.watch_demo.true_stops import Stops, TrueStop
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import BodySize, Participant, VendorName, participants
from deconflict.simulation.robot_state import RobotState, robot_states
from deconflict.simulation.scripted_annex import split
from deconflict.simulation.vendors.broker_sender import LANGUAGES, ON_BROKERS
from deconflict.simulation.vendors.dialects import DIALECTS
from deconflict.simulation.vendors.iso_dialect import IsoRobot
from deconflict.simulation.vendors.senders import OWN_PATH
from deconflict.simulation.vendors.vda_dialect import VdaRobot
from ingest.batch import Floats, Ints
from ingest.fleet.fleet import Fleet
from ingest.port.connection import Connection

STEP_S = 0.1
TOPICS_FROM = 2000
"""Number of the first connection that is a topic."""
DELIVERY_S = (0.03, 0.2)
"""Shortest and longest delivery time of a message."""


@dataclass(slots=True)
class Truth:
    """The truth so far. Robots are rows; those of the annex follow those of the halls."""

    encounters: list[TrueEncounter] = field(default_factory=list)
    envelopes: Floats = field(default_factory=lambda: np.empty((0, 5)))
    """(n, 5) x, y, yaw of each envelope's centre, its length and its width."""
    floor: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    stood_s: Floats = field(default_factory=lambda: np.empty(0))
    """(n,) how long each has stood."""
    open: dict[tuple[int, int], TrueEncounter] = field(default_factory=dict)


class Floor:
    """A floor with robots. `step` advances the time. Time 0 is `start_s`, seconds since the epoch."""

    def __init__(self, robots: int, seed: int, start_s: float, clearance_m: float) -> None:
        rng = np.random.default_rng(seed)
        members, self._annex = split(participants(robots))
        self.world = World(layout_for(robots), members, rng)
        self.world.spread_start()
        self.members: tuple[Participant, ...] = (*members, *self._annex.members)
        self.rows = {member.uuid: row for row, member in enumerate(self.members)}
        self._start_s, self._clearance_m = start_s, clearance_m
        self._delays = np.random.default_rng(seed + 1)
        self._every_s = np.array([member.make.report_every_s for member in self.members])
        self._phase_s = self._every_s * (np.arange(len(self.members)) * 0.618 % 1.0)
        self._introduced: set[int] = set()
        self._speakers: dict[int, VdaRobot | IsoRobot] = {}
        """By row, the robots of the vendors that report to a broker."""
        self._topics: dict[str, Connection] = {}
        self._stops = Stops(self.world)
        self.truth = Truth(stood_s=np.zeros(len(self.members)))

    @property
    def now_s(self) -> float:
        """Seconds since the epoch."""
        return self._start_s + self.world.t_s

    @property
    def stops(self) -> list[TrueStop]:
        return self._stops.found

    def step(self) -> Iterator[tuple[float, bytes, Connection]]:
        """Advance by one step. Yields the sent messages with their arrival times."""
        before = np.floor((self.world.t_s + self._phase_s) / self._every_s)
        self.world.step(STEP_S)
        self._stops.update(STEP_S)
        self._update_truth()
        due = np.flatnonzero(np.floor((self.world.t_s + self._phase_s) / self._every_s) > before)
        for row, robot in zip(due.tolist(), self._robots(due), strict=True):
            vendor = robot.member.make.vendor
            introduce = row not in self._introduced
            self._introduced.add(row)
            at_s = self.now_s + self._delays.uniform(*DELIVERY_S)
            if vendor in ON_BROKERS:
                speaker = self._speakers.setdefault(row, ON_BROKERS[vendor]())
                for message in speaker.messages(robot, self.now_s, introduce=introduce):
                    yield at_s, message.raw, self._topic_connection(message.topic, vendor)
                continue
            for raw in DIALECTS[vendor].messages(robot, self.now_s, introduce=introduce):
                yield at_s, raw, _connection(row, vendor)

    def _topic_connection(self, topic: str, vendor: VendorName) -> Connection:
        """The connection that a topic of a broker counts as."""
        number, language = TOPICS_FROM + len(self._topics), LANGUAGES[vendor]
        return self._topics.setdefault(topic, Connection(number, "", "/", vendor.value, language=language, topic=topic))

    def _robots(self, rows: Ints) -> list[RobotState]:
        halls = len(self.world)
        players = [self._annex.robot(row - halls, self.world.t_s) for row in rows.tolist() if row >= halls]
        return [*robot_states(self.world, rows[rows < halls]), *players]

    def _update_truth(self) -> None:
        """Update the truth: the positions of all robots, and the near pairs."""
        players = self._robots(np.arange(len(self.world), len(self.members)))
        before, truth, t_s = self.truth.envelopes, self.truth, self.world.t_s
        played = np.array([_envelope(player) for player in players]).reshape(-1, 5)
        truth.envelopes = np.vstack([self.world.envelopes(), played])
        truth.floor = np.concatenate([self.world.floor, np.array([player.floor for player in players], np.int64)])
        if len(before):
            moved: NDArray[np.bool_] = np.hypot(*(truth.envelopes - before)[:, :2].T) > 0.05 * STEP_S
            truth.stood_s = np.where(moved, 0.0, truth.stood_s + STEP_S)
        for pair, separation_m in near_pairs(truth.envelopes, truth.floor, self._clearance_m):
            if pair not in truth.open:
                truth.open[pair] = TrueEncounter(pair, t_s, t_s, separation_m)
                truth.encounters.append(truth.open[pair])
            truth.open[pair].last_s = t_s
            truth.open[pair].separation_m = min(truth.open[pair].separation_m, separation_m)
        for pair in [pair for pair, meeting in truth.open.items() if t_s - meeting.last_s > SAME_ENCOUNTER_S]:
            del truth.open[pair]


def _envelope(robot: RobotState) -> tuple[float, float, float, float, float]:
    body: BodySize = robot.member.make.body
    x_m = robot.x_m + body.ahead_m * np.cos(robot.yaw_rad)
    y_m = robot.y_m + body.ahead_m * np.sin(robot.yaw_rad)
    return x_m, y_m, robot.yaw_rad, body.length_m, body.width_m


def _connection(row: int, vendor: VendorName) -> Connection:
    number = 1000 if vendor is VendorName.BASALT else row + 1
    path = f"/{vendor}" if vendor in OWN_PATH else "/"
    return Connection(number, "", path, vendor.value if vendor in OWN_PATH else None)


class Post:
    """Messages in transit, by arrival."""

    def __init__(self) -> None:
        self._on_way: list[tuple[float, int, bytes, Connection]] = []
        self._sent = 0

    def put(self, arrival_s: float, raw: bytes, connection: Connection) -> None:
        self._sent += 1
        insort(self._on_way, (arrival_s, self._sent, raw, connection), key=lambda message: message[:2])

    def carry(self, floor: Floor, fleet: Fleet, changed: Callable[[bytes], bytes] = lambda raw: raw) -> None:
        """Advance a floor by one step, and have a fleet receive what arrives until then. Each message is `changed`."""
        for arrival_s, raw, connection in floor.step():
            self.put(arrival_s, changed(raw), connection)
        for arrival_s, raw, connection in self.arrived(floor.now_s):
            fleet.receive(raw, arrival_s, connection)

    def arrived(self, now_s: float) -> Iterator[tuple[float, bytes, Connection]]:
        while self._on_way and self._on_way[0][0] <= now_s:
            at_s, _, raw, connection = self._on_way.pop(0)
            yield at_s, raw, connection
