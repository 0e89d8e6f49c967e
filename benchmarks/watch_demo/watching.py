"""The service on the demo's floor: every advisory as a person sees it, with the true state of its robots."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, inf
from pathlib import Path

import numpy as np

from benchmarks.watch_demo.floor import STEP_S, Floor, Post
from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.engine.engine import Engine
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.site_file import load
from deconflict.simulation.demo.advice_follower import Follow, Follower
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.driving.lost_time import LostTimeCounter
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory
from deconflict_client.situations import Situation, situations_of
from ingest.batch import Batch
from ingest.measures.measures import Measures
from metrics.scoring.contention_scores import ContentionScores
from metrics.scoring.situation_scores import SituationScores
from metrics.truth.advised_waits import AdvisedWaits

START_S = 1_790_000_000.0


@dataclass(slots=True)
class Alert:
    """One advisory. Times are seconds after the start."""

    kind: str
    names: tuple[str, ...]
    vendors: tuple[str, ...]
    rows: tuple[int, ...]
    raised_s: float
    probability: float | None
    time_to_conflict_s: float
    encounter_class: str
    basis: tuple[str, ...]
    summary: str
    separation_m: float | None
    """The smallest separation that was predicted when it was raised."""
    gap_m: float
    """Distance between the centres of the first two robots when it was raised; inf if on different floors."""
    stood_s: tuple[float, ...]
    """How long each robot had stood when it was raised."""
    cleared_s: float = inf
    ended: str = ""
    stands_s: list[float] = field(default_factory=list)
    """For each robot, how long it stood in total while this was open."""
    revisions: int = 1


class Watch:
    """A run, step by step."""

    def __init__(self, robots: int, seed: int, site: Path | None = None, follow: Follow = Follow.NONE) -> None:
        self._site = load(site or demo_site())
        self.clearance_m = self._site.conflict.clearance_m
        self.floor = Floor(robots, seed, START_S, self.clearance_m)
        self._fleet, self._engine, self._post = fast_fleet_of(self._site, Measures()), Engine(self._site), Post()
        self._everything = True
        self.situations = SituationLifecycle(PlaceNames.of(self._site).describe)
        self.situation_scores, self.contention, self.waits = (
            SituationScores(),
            ContentionScores(self._site),
            AdvisedWaits(),
        )
        self._is_followed = follow is not Follow.NONE
        self.follower = Follower(self.floor.world, self.floor.world.rows(), follow)
        self.lost_time = LostTimeCounter(self.floor.world)
        self.alerts: dict[str, Alert] = {}
        self.most_open = 0
        self.open_s = 0.0

    def run(self, seconds: float) -> None:
        while self.floor.world.t_s < seconds:
            self.step()

    def step(self) -> None:
        """One step of the world, which is one tick of the service."""
        self._post.carry(self.floor, self._fleet)
        now_s = self.floor.now_s
        batch = self._fleet.next_batch(now_s, self._everything)
        self._engine.receive(batch)
        self._everything = False
        revisions = self._engine.step(now_s)
        published = self.situations.published(now_s, revisions)
        for revision in [*published, *self._engine.advise(now_s, self.follower.take_answers())]:
            self.follower.pass_on(revision, now_s)
        for advisory in revisions:
            self._take(advisory)
        self._score(now_s, batch, revisions, situations_of(published))
        self.lost_time.update(STEP_S)
        standing = self.floor.truth.stood_s > 0
        open_now = [alert for alert in self.alerts.values() if alert.cleared_s == inf]
        for alert in open_now:
            alert.stands_s = [alert.stands_s[k] + STEP_S * bool(standing[row]) for k, row in enumerate(alert.rows)]
        conflicts = sum(alert.kind == "conflict" for alert in open_now)
        self.most_open, self.open_s = max(self.most_open, conflicts), self.open_s + STEP_S * conflicts

    def _score(
        self, now_s: float, batch: Batch, advisories: Sequence[AnyAdvisory], situations: Sequence[Situation]
    ) -> None:
        self.contention.add_batch(batch)
        self.contention.add_output(now_s, advisories)
        self.situation_scores.add(now_s, situations)
        if self._is_followed:
            self.waits.add(now_s, self._engine.foresight.following_advice(now_s))

    def _take(self, advisory: AnyAdvisory) -> None:
        if advisory.id not in self.alerts:
            self.alerts[advisory.id] = self._alert(advisory)
        alert = self.alerts[advisory.id]
        alert.revisions = advisory.revision
        if advisory.state is AdvisoryState.CLEARED:
            alert.cleared_s, alert.ended = self.floor.world.t_s, advisory.cleared_because or ""

    def _alert(self, advisory: AnyAdvisory) -> Alert:
        truth = self.floor.truth
        rows = tuple(self.floor.rows[robot.lower()] for robot in advisory.robots)
        gap_m = inf
        if len(rows) > 1 and truth.floor[rows[0]] == truth.floor[rows[1]]:
            gap_m = hypot(*(truth.envelopes[rows[0]] - truth.envelopes[rows[1]])[:2])
        conflict = advisory if isinstance(advisory, ConflictAdvisory) else None
        return Alert(
            kind=advisory.kind,
            names=advisory.names,
            vendors=advisory.vendors,
            rows=rows,
            raised_s=self.floor.world.t_s,
            probability=conflict.probability if conflict else None,
            time_to_conflict_s=advisory.time_to_conflict_s,
            encounter_class=conflict.encounter_class.value if conflict else "",
            basis=conflict.basis if conflict else (),
            summary=advisory.summary,
            separation_m=conflict.min_separation_m if conflict else None,
            gap_m=gap_m,
            stood_s=tuple(float(s) for s in np.round(truth.stood_s[list(rows)], 1)),
            stands_s=[0.0] * len(rows),
        )
