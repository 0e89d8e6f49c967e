"""Scenes side by side through the fleet and the engine of a replay: what each scene was warned of."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from benchmarks.less_told.fields import Fields
from benchmarks.less_told.languages import iso21423, massrobotics, vda5050
from benchmarks.less_told.languages.sending import Sent
from benchmarks.less_told.scenes import SECONDS, VENDORS, Robot, Scene, motion_of
from benchmarks.planned_floors.logs.messages import DATUM, START_S
from benchmarks.planned_floors.logs.reports import Report
from benchmarks.planned_floors.logs.reports import Robot as ReportingRobot
from benchmarks.planned_floors.scoring.alerts import Alert, alerts_of_revisions
from benchmarks.planned_floors.scoring.judged_cases import Judge, Verdict
from benchmarks.planned_floors.truth.floor_truth import FloorTruth
from benchmarks.planned_floors.truth.outcomes import Happenings, happenings
from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import DEFAULT
from ingest.batch import Floats
from ingest.settings import Datum, Vendor
from metrics.replay.engine_run import EngineRun
from metrics.replay.recorded_passes import PassReader

SITE = DEFAULT.model_copy(
    update={
        "datums": (Datum(id=DATUM, name="Hall"),),
        "vendors": tuple(Vendor(name=vendor) for vendor in VENDORS),
    }
)
CLEARANCE_M = 0.3
TOLD_2_S = 1
"""Column of `Cases.outcomes`: raised 2 s before the onset and standing at it."""
ANY = -1


class Language(NamedTuple):
    """How the robots of a scene speak."""

    uuid_of: Callable[[Robot], str]
    messages: Callable[[Robot, Fields], Iterator[Sent]]


LANGUAGES: Mapping[str, Language] = {
    "massrobotics": Language(massrobotics.uuid_of, massrobotics.messages),
    "vda5050": Language(vda5050.uuid_of, vda5050.messages),
    "iso21423": Language(iso21423.uuid_of, iso21423.messages),
}


class SceneScore(NamedTuple):
    """What a scene was warned of with one set of fields."""

    outcomes: int
    """Encounters that should have had a warning."""
    told_2s: int
    """Those of which an alert was raised at least 2 s before, and stood."""
    any_alert: int
    alerts: int
    in_vain: int
    robot_s: float
    """Seconds for which its robots were there."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneFloor:
    """Scenes side by side, in one language."""

    scenes: Sequence[Scene]
    language: str

    def scores(self, fields: Fields) -> list[SceneScore]:
        """The scores of its scenes if the robots report these fields."""
        spoken, robots = LANGUAGES[self.language], [robot for scene in self.scenes for robot in scene.robots]
        uuids = [spoken.uuid_of(robot) for robot in robots]
        sent = sorted((each for robot in robots for each in spoken.messages(robot, fields)), key=lambda each: each[0])
        truth = FloorTruth(motion_of(robots, uuids, START_S), [], [])
        vendor_of = {uuid: robot.vendor for uuid, robot in zip(uuids, robots, strict=True)}
        happened = happenings(truth, CLEARANCE_M, vendor_of)
        alerts = alerts_of_revisions(_revisions(sent), truth.motion.end_s)
        reporting = [_reporting(uuid, robot, truth.motion.end_s) for uuid, robot in zip(uuids, robots, strict=True)]
        cases = Judge(truth, happened, reporting, START_S).cases(alerts, ())
        scene_of = {uuid: row // 2 for row, uuid in enumerate(uuids)}
        return self._scored(_Judged(happened, alerts, cases.outcomes, cases.verdicts[:, 0]), scene_of)

    def _scored(self, judged: "_Judged", scene_of: Mapping[str, int]) -> list[SceneScore]:
        counts = np.zeros((len(self.scenes), 5), np.int64)
        for (pair, _), row in zip(judged.happened.warnable, judged.warned, strict=True):
            counts[scene_of[pair[0]], :3] += (1, int(row[TOLD_2_S]), int(row[ANY]))
        for alert, verdict in zip(judged.alerts, judged.verdicts, strict=True):
            counts[scene_of[alert.pair[0]], 3:] += (1, int(verdict == Verdict.IN_VAIN))
        return [
            SceneScore(outcomes, told_of, any_alert, alerts_raised, in_vain, 2 * SECONDS)
            for outcomes, told_of, any_alert, alerts_raised, in_vain in counts.tolist()
        ]


class _Judged(NamedTuple):
    happened: Happenings
    alerts: list[Alert]
    warned: Floats
    """(outcomes, 5) as `Cases.outcomes`."""
    verdicts: Floats
    """(alerts,)"""


def _revisions(sent: Sequence[Sent]) -> Iterator[dict[str, Any]]:
    """The revisions of conflicts that the service publishes."""
    reader, engine = PassReader(SITE), EngineRun(SITE, CLEARANCE_M, StartState())
    for passes in (reader.passes_of(each.message for each in sent), reader.last_passes()):
        for engine_pass in passes:
            for revision in engine.advance(engine_pass).advisories:
                if revision.kind == "conflict":
                    yield revision.model_dump(mode="json")


def _reporting(uuid: str, robot: Robot, end_s: float) -> ReportingRobot:
    """A robot that was heard each second, for the judge."""
    nothing = np.empty((0, 4))
    times_s = np.arange(START_S, end_s + 1.0).tolist()
    reports = [Report(t_s, t_s, 0.0, 0.0, 0.0, 0.0, nothing) for t_s in times_s]
    return ReportingRobot(uuid, robot.vendor, robot.length_m, robot.width_m, reports)
