"""The eight logs: five are in this folder; three may not be (licences), and are found by `DECONFLICT_RECORDINGS`."""

import os
from dataclasses import dataclass
from pathlib import Path

LOGS = Path(__file__).parent / "logs"


@dataclass(frozen=True, slots=True)
class KeptLog:
    """A log whose decisions are kept."""

    name: str
    about: str
    recording: str = ""
    """Its file among the recordings, if it may not be in this folder."""
    clearance_m: float | None = None
    """The site's if None."""
    site_name: str = ""
    """Of the site file in `LOGS` with which it was recorded, if any."""

    def file(self) -> Path | None:
        """None if it is not here."""
        if not self.recording:
            return LOGS / f"{self.name}.jsonl.zst"
        folder = os.environ.get("DECONFLICT_RECORDINGS")
        file = Path(folder) / self.recording if folder else None
        return file if file and file.exists() else None

    def site(self) -> Path | None:
        return LOGS / f"{self.site_name}.site.toml" if self.site_name else None


KEPT_LOGS = (
    KeptLog("people", "people who cross a street as if they were robots", "zara02.cv.jsonl.gz", 0.3),
    KeptLog("five-robots", "five small robots in a laboratory", "mrclam7.cv.jsonl.gz", 0.3),
    KeptLog("random-floor", "robots with plans that do not know each other", "random.blind.plan.jsonl.gz", 0.3),
    KeptLog("planned-floor", "robots of vendors that plan without each other, in a warehouse", clearance_m=0.3),
    KeptLog("demo", "the demo, recorded by the service, with the ticks of its engine", site_name="hall"),
    KeptLog("three-languages", "MassRobotics over WebSocket, VDA 5050 and ISO 21423 over a broker", site_name="hall"),
    KeptLog("drills", "queues, blockages, deadlocks, and robots that follow the advice", site_name="drills"),
    KeptLog("cluster", "what both ingests of a cluster of two engines recorded", site_name="hall"),
)
