"""The service beside the simulated robots: it hears their reports, and the robots do what its situations ask for."""

from collections.abc import Sequence

import numpy as np

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.engine.engine import Engine
from deconflict.settings.site import Site
from deconflict.simulation.demo.advice_follower import Follow, Follower
from deconflict.simulation.driving.motion import Activity
from ingest.batch import AMOUNTS, Basis, Batch, Destinations, Floats, Forecasts, Ints
from metrics.whatif.simulated.replayed_floor import ReplayedFloor

START_S = 1_790_000_000.0
"""Time 0 of the simulation, in seconds since the epoch."""
PASS_STEPS = 2
"""Steps from one pass of the engine to the next."""
REPORT_S = 1.0
PATH_S = np.arange(1.0, 11.0)
"""Robots report where they will be at these times: as if they were alone."""
SAMPLES = 200


class SimulatedService:
    """One service, and the robots that follow its advice. Call `step` after each step of the world."""

    def __init__(self, world: ReplayedFloor, site: Site, floors: tuple[str, ...]) -> None:
        self._world, self._floors = world, floors
        self._engine, self._situations = Engine(site), SituationLifecycle(PlaceNames.of(site).describe)
        rows = {identity.uuid.lower(): row for row, identity in enumerate(world.identities)}
        self._follower = Follower(world, rows, Follow.SITUATIONS)
        self._steps = 0
        self._reported_s = -REPORT_S * (np.arange(len(world)) * 0.618 % 1.0)

    def step(self) -> None:
        self._steps += 1
        if self._steps % PASS_STEPS:
            return
        now_s, world = START_S + self._world.t_s, self._world
        due = np.flatnonzero((world.t_s - self._reported_s >= REPORT_S) & (world.floor >= 0))
        self._reported_s[due] = world.t_s
        self._engine.receive(self._batch(due, now_s))
        for revision in self._situations.published(now_s, self._engine.step(now_s)):
            self._follower.pass_on(revision, now_s)

    def _batch(self, rows: Ints, now_s: float) -> Batch:
        """The reports of these robots (n,)."""
        identities = [self._world.identities[row] for row in rows.tolist()]
        drives = np.isin(self._world.doing[rows], (Activity.DRIVING, Activity.BACKING, Activity.HOLDING))
        times_s, empty, n = np.full(len(rows), now_s), np.empty(0), len(rows)
        return Batch(
            now_s=now_s,
            floors=self._floors,
            robots=tuple(identity.uuid for identity in identities),
            vendors=tuple(identity.vendor for identity in identities),
            models=tuple(identity.model for identity in identities),
            names=tuple(identity.name for identity in identities),
            states=tuple("navigating" if driving else "idle" for driving in drives.tolist()),
            statuses=np.ones(n, np.int64),
            first_arrival_s=times_s,
            arrival_s=times_s,
            event_s=times_s,
            basis=np.where(drives, int(Basis.PATH), int(Basis.STATIONARY)),
            doubt_m=np.zeros(n),
            reports_within_s=np.zeros(n),
            amounts=np.full(n, np.nan, AMOUNTS),
            forecasts=self._forecasts(rows, now_s, drives.tolist()),
            destinations=Destinations(np.zeros(n + 1, np.int64), empty, empty, empty, empty.astype(np.int64)),
            gone=(),
        )

    def _forecasts(self, rows: Ints, now_s: float, drives: Sequence[bool]) -> Forecasts:
        world = self._world
        envelopes = world.envelopes()[rows]
        knots = [
            np.vstack([here[:3], self._ahead(row)]) if driving else here[None, :3]
            for row, driving, here in zip(rows.tolist(), drives, envelopes, strict=True)
        ]
        counts = [len(poses) for poses in knots]
        after_s = np.concatenate([[0.0], PATH_S])
        x_m, y_m, yaw_rad = np.vstack(knots).T if knots else np.empty((3, 0))
        return Forecasts(
            start=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            t_s=np.concatenate([now_s + after_s[:count] for count in counts]) if counts else np.empty(0),
            x_m=x_m,
            y_m=y_m,
            yaw_rad=yaw_rad,
            floor=np.repeat(world.floor[rows], counts),
            length_m=envelopes[:, 3],
            width_m=envelopes[:, 4],
            bottom_m=np.full(len(rows), -np.inf),
            top_m=np.full(len(rows), np.inf),
        )

    def _ahead(self, robot: int) -> Floats:
        """(k, 3) the poses of a robot at `PATH_S` if it were alone."""
        world = self._world
        at_m = np.linspace(float(world.progress_m[robot]), float(world.tracks.length_m[robot]), SAMPLES)
        rows = np.full(SAMPLES, robot)
        due_s = world.tracks.seconds(rows, at_m)
        poses: Floats = world.tracks.poses(rows[: len(PATH_S)], np.interp(PATH_S, due_s - due_s[0], at_m)).T
        return poses
