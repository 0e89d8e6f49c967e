"""Scores one floor from its files alone: the log, the truth, and the alerts."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.planned_floors.logs.reports import Robot, reported_motion, robots_in_file
from benchmarks.planned_floors.scoring.alerts import BELIEVER, Alert, alerts_of_revisions, revisions_in
from benchmarks.planned_floors.scoring.believer import believed_alerts
from benchmarks.planned_floors.scoring.judged_cases import Cases, Judge, Sample
from benchmarks.planned_floors.truth.floor_truth import FloorTruth, load
from benchmarks.planned_floors.truth.outcomes import Happenings, happenings


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """A log with its truth, on which alerts can be scored."""

    robots: list[Robot]
    truth: FloorTruth
    happened: Happenings
    clearance_m: float
    after_s: float
    """Events earlier than this after the start are not scored."""

    @classmethod
    def read(cls, log_file: Path, truth_path: Path, clearance_m: float, after_s: float = 0.0) -> "Floor":
        robots = robots_in_file(log_file)
        truth = load(truth_path, reported_motion(robots))
        vendor_of = {robot.uuid: robot.vendor for robot in robots}
        return cls(robots, truth, happenings(truth, clearance_m, vendor_of), clearance_m, after_s)

    @property
    def end_s(self) -> float:
        return max(robot.reports[-1].received_s for robot in self.robots)

    def cases(self, alerts: list[Alert], samples: Sequence[Sample] = ()) -> Cases:
        """The judged cases of alerts and published probabilities."""
        from_s = self.truth.motion.start_s + self.after_s
        judge = Judge(self.truth, self.happened, self.robots, from_s)
        return judge.cases(alerts, samples)

    def believer(self) -> Cases:
        """The judged cases of the path believer's alerts."""
        return self.cases(believed_alerts(self.robots, self.clearance_m))


def score(
    log_file: Path, truth_path: Path, advisories: list[Path], clearance_m: float, after_s: float
) -> dict[str, Cases]:
    """The cases of the believer, and of each file of advisories by its name."""
    floor = Floor.read(log_file, truth_path, clearance_m, after_s)
    found = {BELIEVER: floor.believer()}
    for path in advisories:
        found[path.stem] = floor.cases(alerts_of_revisions(revisions_in(path.read_text()), floor.end_s))
    return found
