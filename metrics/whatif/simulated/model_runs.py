"""Runs of a plan with several seeds: what robots lose to others, how many trips they drive, how often they are held
up."""

from dataclasses import dataclass

import numpy as np

from deconflict.foresight.losses.loss_finder import LEAST_LOST_S
from deconflict.simulation.driving.lost_time import CausedDelays
from deconflict.simulation.driving.motion import MovingRobots
from deconflict.simulation.driving.protection import NOBODY
from ingest.batch import Bools, Floats, Ints
from metrics.whatif.change import ROOM_M
from metrics.whatif.demand import Demand
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.simulated.replayed_floor import ReplayedFloor
from metrics.whatif.simulated.simulated_plan import SimulatedPlan
from metrics.whatif.simulated.simulated_service import SimulatedService

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
