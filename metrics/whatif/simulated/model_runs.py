"""Runs of a plan with several seeds: what robots lose to others, how many trips they drive, how often they are held
up. Beside the robots is the service: it hears their reports, and they do what its situations ask for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.engine.engine import Engine
from deconflict.foresight.losses.loss_finder import LEAST_LOST_S
from deconflict.settings.site import Site
from deconflict.simulation.demo.advice_follower import Follow, Follower
from deconflict.simulation.driving.lost_time import CausedDelays
from deconflict.simulation.driving.motion import Activity, MovingRobots
from deconflict.simulation.driving.protection import NOBODY
from ingest.batch import AMOUNTS, Basis, Batch, Bools, Destinations, Floats, Forecasts, Ints
from metrics.whatif.change import ROOM_M
from metrics.whatif.demand import Demand
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.replayed_floor import ReplayedFloor
from metrics.whatif.simulated.simulated_plan import SimulatedPlan

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


STEP_S = 0.2
COUNTED_SHARE = 0.9
"""Only this share of the log is counted, from its start: a change may let robots drive more trips than the log has."""
SERVICE = -2
"""Stands for the service where others stand for the robot that is in the way."""
DELAY_S = 1.0
"""A loss of at least this long counts as one time that a robot is held up."""


@dataclass(frozen=True, slots=True)
class FloorFigures:
    """What happened on a floor. People lose nothing here, but robots lose to them."""

    lost_s: float
    """By robots, to others."""
    trips: float
    delays: float
    """How often a robot lost `DELAY_S` or more to another one."""

    def per_hour(self, span_s: float) -> "FloorFigures":
        share = 3600.0 / span_s
        return FloorFigures(self.lost_s * share, self.trips * share, self.delays * share)


def log_figures(floor: RecordedFloor, demand: Demand, until_s: float) -> FloorFigures:
    """What the log says, until a time."""
    people = {track.uuid for track in floor.tracks if track.is_person}
    losses = [loss for loss in floor.losses if loss.robot not in people and loss.from_s < until_s]
    driven = [trip for robot in demand.robots if not robot.track.is_person for trip in robot.trips]
    trips = [trip for trip in driven if trip.is_whole and trip.stop.from_s < until_s]
    delays = sum(loss.lost_s >= DELAY_S for loss in losses)
    return FloorFigures(sum(loss.lost_s for loss in losses), len(trips), delays)


def model_figures(plan: SimulatedPlan, seed: int, until_s: float) -> Floats:
    """(n, 3) what each robot loses, drives and is held up if the plan is driven: the fields of `FloorFigures`."""
    world = ReplayedFloor(plan.robots, plan.crossings, np.random.default_rng(seed), ROOM_M, plan.wider)
    world.crossings.shared = plan.shared
    losses = OpenLosses(world)
    service = SimulatedService(world, plan.advised_by, plan.floors) if plan.advised_by else None
    while world.t_s < until_s:
        world.step(STEP_S)
        if service:
            service.step()
        losses.update(STEP_S)
    lost_s, delays = losses.finish()
    return np.column_stack([lost_s, world.arrivals, delays])


class OpenLosses:
    """Joins the losses of steps as the finder of losses does: one loss for as long as its cause stands. People lose
    nothing."""

    def __init__(self, world: MovingRobots) -> None:
        self._world, self._delays = world, CausedDelays(world)
        self._lost_s = np.zeros(len(world))
        self._cause = np.full(len(world), NOBODY)
        self._ended_s = np.zeros(len(world))
        """(n,) lost in losses that have ended. Short ones are left out, as in a log."""
        self._delays_ended = np.zeros(len(world))

    def update(self, dt_s: float) -> None:
        self._delays.update(dt_s)
        cause = np.where(self._delays.cause == NOBODY, self._instructed(), self._delays.cause)
        cause = np.where(self._delays.driving & ~self._world.person, cause, NOBODY)
        self._end((cause != self._cause) & (self._cause != NOBODY))
        self._cause = cause
        self._lost_s += np.where(cause != NOBODY, self._delays.lost_s, 0.0)

    def _instructed(self) -> Ints:
        """(n,) `SERVICE` for robots that wait or drive slowly because they are told to."""
        return np.where(np.isfinite(self._world.instructions.top_mps(self._world.t_s)), SERVICE, NOBODY)

    def finish(self) -> tuple[Floats, Floats]:
        """(n,) seconds that each has lost, and how often `DELAY_S` or more at once."""
        self._end(self._cause != NOBODY)
        return self._ended_s, self._delays_ended

    def _end(self, ends: Bools) -> None:
        lost_s = np.where(ends, self._lost_s, 0.0)
        self._ended_s += np.where(lost_s >= LEAST_LOST_S, lost_s, 0.0)
        self._delays_ended += lost_s >= DELAY_S
        self._lost_s[ends] = 0.0
