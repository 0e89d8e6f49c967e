"""One floor scored from its files alone: the log, the truth, and what was told."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.planned_floors import alerts, log
from benchmarks.planned_floors.alerts import BELIEVER, Alert
from benchmarks.planned_floors.believer import believed_alerts
from benchmarks.planned_floors.cases import Cases, Judge, Sample
from benchmarks.planned_floors.log import Robot
from benchmarks.planned_floors.outcomes import Happenings, happenings
from benchmarks.planned_floors.truth import FloorTruth, load


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """A log with its truth, ready for alerts to be scored."""

    robots: list[Robot]
    truth: FloorTruth
    happened: Happenings
    clearance_m: float
    after_s: float
    """What happens sooner after the beginning is not scored."""

    @classmethod
    def read(cls, log_file: Path, truth_path: Path, clearance_m: float, after_s: float = 0.0) -> "Floor":
        robots = log.read(log_file)
        truth = load(truth_path, log.reported_motion(robots))
        vendor_of = {robot.uuid: robot.vendor for robot in robots}
        return cls(robots, truth, happenings(truth, clearance_m, vendor_of), clearance_m, after_s)

    @property
    def end_s(self) -> float:
        return max(robot.reports[-1].received_s for robot in self.robots)

    def cases(self, told: list[Alert], samples: Sequence[Sample] = ()) -> Cases:
        """What was told, and the probabilities that were published, judged."""
        from_s = self.truth.motion.start_s + self.after_s
        judge = Judge(self.truth, self.happened, self.robots, from_s)
        return judge.cases(told, samples)

    def believer(self) -> Cases:
        """What the believer of paths would have told, judged."""
        return self.cases(believed_alerts(self.robots, self.clearance_m))


def score(
    log_file: Path, truth_path: Path, advisories: list[Path], clearance_m: float, after_s: float
) -> dict[str, Cases]:
    """The cases of the believer, and of each file of advisories by its name."""
    floor = Floor.read(log_file, truth_path, clearance_m, after_s)
    told = {path.stem: alerts.told(alerts.lines_of(path.read_text()), floor.end_s) for path in advisories}
    return {BELIEVER: floor.believer()} | {name: floor.cases(one) for name, one in told.items()}
