"""The robots and the places around a conflict: who is on the floor, and how two robots meet."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from deconflict.advisories.words.conflict_wording import GONE, Absence, Party
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.advisories.words.words import Spot
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.presence import Presence
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.foresight.probability.waiting_robots import late_starts
from deconflict.sweep.geometry.encounter import Encounter, Encounters
from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.shapes.shape_encounters import encounter, separation_m
from deconflict_client.advisory import ClearedCode
from ingest.batch import Basis, Floats, FloorPoint, Forecasts, Pair
from ingest.measures.measures import OTHER

MOST_VENDORS = 8
_BASIS_NAMES = {basis: basis.name.lower() for basis in Basis}


class LiveScene:
    """What the life of conflict advisories asks of the engine."""

    def __init__(
        self,
        live: LiveRobots,
        presence: Presence,
        foresight: ProbabilityEstimator,
        sweeper: Sweeper,
        place_names: PlaceNames,
    ) -> None:
        self._live, self._presence, self._foresight = live, presence, foresight
        self._sweeper, self._place_names = sweeper, place_names
        self._vendors_of: dict[str, list[str]] = {}
        """By source, its first vendors."""

    def is_present(self, uuid: str) -> bool:
        """Whether a robot is on the floor."""
        return uuid in self._live.robots

    def absence(self, uuid: str) -> Absence | None:
        """Why a robot is not on the floor; None if it is, as far as is known."""
        if uuid in self._live.robots:
            if uuid in self._presence.moved:
                return Absence(ClearedCode.MOVED_BY_HAND)
            return Absence(ClearedCode.LEFT_IN_SILENCE) if self._presence.silences.has_probably_left(uuid) else None
        if uuid in self._presence.off_floor:
            return Absence(ClearedCode.OFF_FLOOR)
        removed = self._presence.removed.robots.get(uuid)
        return Absence(ClearedCode.DRIVEN_THROUGH, removed.by) if removed else GONE

    def account(self, uuid: str) -> str:
        """Whose revisions are counted together with those of a robot that is on the floor.

        Its vendor; `OTHER` for all vendors of a source but its first `MOST_VENDORS`, since it can invent some.
        """
        robot = self._live.robots[uuid]
        vendors = self._vendors_of.setdefault(robot.source, [])
        if robot.vendor not in vendors and len(vendors) < MOST_VENDORS:
            vendors.append(robot.vendor)
        return robot.vendor if robot.vendor in vendors else OTHER

    def party(self, uuid: str, now_s: float) -> Party:
        """What an advisory says of a robot that is on the floor."""
        robot = self._live.robots[uuid]
        silent_s = self._presence.silent_s(uuid, now_s)
        remarks = {"distrusted": self._foresight.is_distrusted(uuid), "silent": silent_s is not None}
        basis = _BASIS_NAMES[robot.basis] + "".join(f" ({remark})" for remark, holds in remarks.items() if holds)
        return Party(robot.name, robot.vendor, basis, robot.basis is Basis.STATIONARY, silent_s, robot.participant)

    def stands(self, uuid: str) -> bool:
        """Whether a robot is on the floor and stands there."""
        robot = self._live.robots.get(uuid)
        return robot is not None and (robot.basis is Basis.STATIONARY or self._foresight.is_standing(uuid))

    def encounter(self, pair: Pair, contact_s: float) -> Encounter:
        """How two robots meet at `contact_s`."""
        late_s = late_starts(pair, self._foresight.robots, self._foresight.pairs)
        a, b = (self._begun_late(uuid, each_s) for uuid, each_s in zip(pair, late_s, strict=True))
        return encounter(a, b, contact_s)

    def _begun_late(self, uuid: str, late_s: float) -> tuple[Forecasts, int]:
        """The forecast of a robot that starts by so much later than it says, and its row."""
        robot = self._live.robots[uuid]
        if not late_s:
            return robot.batch_forecasts, robot.row
        forecast = robot.batch_forecasts.single(robot.row)
        return replace(forecast, t_s=forecast.t_s + late_s), 0

    def encounters(self, pairs: Sequence[Pair], contact_s: Floats) -> Encounters:
        """How each pair meets at its time, as `encounter` but for rounding errors; the place is nan if not known."""
        met, foresight = self._sweeper.encounters(pairs, contact_s), self._foresight
        if foresight.pairs["late_s"].any():
            is_late = [any(late_starts(pair, foresight.robots, foresight.pairs)) for pair in pairs]
            met["x"][is_late] = met["y"][is_late] = np.nan
        return met

    def separation_m(self, pair: Pair, now_s: float) -> float | None:
        """The separation of two robots; None if they are on different floors."""
        a, b = (self._live.robots[uuid] for uuid in pair)
        return separation_m((a.batch_forecasts, a.row), (b.batch_forecasts, b.row), now_s)

    def datum(self, met: Encounter) -> str:
        """The id of the datum of an encounter's floor."""
        return self._live.floors[met.floor]

    def spots(self, encounters: Sequence[Encounter]) -> list[Spot]:
        """Where each encounter is."""
        return self._place_names.describe([FloorPoint(self.datum(met), met.x_m, met.y_m) for met in encounters])
