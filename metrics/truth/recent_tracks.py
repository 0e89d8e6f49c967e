"""What robots did lately by their own reports, for the exact measure of an event that was found by samples."""

from collections import defaultdict

from deconflict.foresight.near_misses.near_events import AFTER_S, BEFORE_S, NearEvent, event_at
from deconflict.foresight.near_misses.recorded_track import RecordedTrack, ReportedPose
from ingest.batch import Batch, Pair

KEPT_S = BEFORE_S + AFTER_S + 30.0


class RecentTracks:
    """The reports of each robot over the last `KEPT_S`, or some more."""

    def __init__(self) -> None:
        self._tracks: defaultdict[str, RecordedTrack] = defaultdict(RecordedTrack)

    def add_batch(self, batch: Batch) -> None:
        """Add the present poses of robots: the first knots of their forecasts."""
        f = batch.forecasts
        columns = (
            *(column[f.start[:-1]] for column in (f.t_s, f.x_m, f.y_m, f.yaw_rad, f.floor)),
            f.bottom_m,
            f.top_m,
            f.length_m,
            f.width_m,
        )
        poses = map(ReportedPose, *(column.tolist() for column in columns))
        for row, (robot, pose) in enumerate(zip(batch.robots, poses, strict=True)):
            track = self._tracks[robot]
            track.add(pose, f.shape(row))
            track.forget_before(pose.t_s - KEPT_S)

    def event(self, pair: Pair, clearance_m: float, at_s: float, until_s: float) -> NearEvent | None:
        """The event of a pair at a moment; None if the two kept the clearance."""
        a, b = (self._tracks[robot].forecasts() for robot in pair)
        return event_at(a, b, clearance_m, at_s, until_s)
