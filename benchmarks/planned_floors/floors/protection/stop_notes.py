"""Records of stops: which robot yielded to which, with begin and end."""

from dataclasses import dataclass

from benchmarks.planned_floors.floors.driving.driving import ACCELERATION_MPS2
from benchmarks.planned_floors.truth.floor_truth import Stop
from benchmarks.planned_floors.truth.motion import STEP_S

STANDS_MPS = 0.02
COUNTED_S = 5.0
"""Lost progress is measured within this time after the onset."""
LEAST_REFERENCE_MPS = 0.3


@dataclass(slots=True, eq=False)
class StopNote:
    """One stop while it lasts, and while the robot drives around the other after it."""

    robot: int
    by: int
    start_s: float
    v0_mps: float
    kind: str
    end_s: float = 0.0
    standing_s: float = 0.0
    stood_since_s: float | None = None
    lost_s: float = 0.0
    aside_m: float = 0.0
    around: bool = False
    around_until_s: float = 0.0

    def go_on(self, now_s: float, speed_mps: float, aside_m: float) -> None:
        """Add a step of the stop."""
        if speed_mps < STANDS_MPS:
            self.standing_s += STEP_S
            self.stood_since_s = now_s if self.stood_since_s is None else self.stood_since_s
        else:
            self.stood_since_s = None
        if now_s < self.start_s + COUNTED_S:
            self.lost_s += max(0.0, 1 - speed_mps / self._reference_mps) * STEP_S
        self.aside_m = max(self.aside_m, abs(aside_m))

    def end(self, now_s: float, speed_mps: float) -> None:
        """The robot drives freely again. What it loses until it is as fast as before counts too."""
        slower_mps = max(self._reference_mps - speed_mps, 0.0)
        if now_s < self.start_s + COUNTED_S:
            self.lost_s += slower_mps**2 / (2 * ACCELERATION_MPS2 * self._reference_mps)
        self.end_s = self.around_until_s = now_s

    def stop(self, start_s: float, uuids: list[str], vendors: list[str]) -> Stop:
        """The stop as an entry of the list of stops. `start_s` is the start of the floor."""
        return Stop(
            robot=uuids[self.robot],
            by=uuids[self.by],
            start_s=start_s + self.start_s,
            end_s=start_s + self.end_s,
            v0_mps=self.v0_mps,
            standing_s=self.standing_s,
            same_vendor=vendors[self.robot] == vendors[self.by],
            around=self.around,
            around_until_s=start_s + self.around_until_s,
            kind=self.kind,
            lost_s=self.lost_s,
            aside_m=self.aside_m,
        )

    @property
    def _reference_mps(self) -> float:
        return max(self.v0_mps, LEAST_REFERENCE_MPS)
