"""The facts of one robot that contention uses."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from deconflict.contention.robots.destinations import PlannedStop
from deconflict.contention.robots.lookahead import STEP_S, STEPS
from deconflict.contention.robots.place_geometry import ZonePassage
from deconflict.sweep.shapes.trailers import rows_of_trains
from deconflict_client.participant_kinds import ParticipantKind
from ingest.batch import Batch


@dataclass(frozen=True, slots=True, eq=False)
class RobotView:
    """One robot, by its newest report. Times are seconds since the epoch; places are in the frame of its floor."""

    uuid: str
    vendor: str
    name: str
    state: str
    """Operational state as reported."""
    pulls_trailers: bool
    """Whether it can't back, because its trailers would fold."""
    reports_within_s: float
    """Its next report may come as late as this by the rules of its language; 0 if there is no such rule."""
    participant: ParticipantKind
    """What it stands for."""
    event_s: float
    """Time of the newest pose."""
    x_m: float
    """Centre of the envelope at that time."""
    y_m: float
    length_m: float
    """Of the envelope, along the heading."""
    width_m: float
    """Of the envelope, across the heading."""
    bottom_m: float
    """The lowest height it reaches; -inf if it is not known."""
    top_m: float
    """The highest height it reaches; inf if it is not known."""
    way_m: float
    """Length of its forecast path in the next ten seconds."""
    stood_s: float
    """Since when it stands where it is."""
    goes: bool
    """Whether it is forecast to move."""
    stands: bool
    """Whether it is at rest, whatever it reports: it has not moved for a while, or is not forecast to."""
    datum: str
    """Datum of its floor; "" if its floor is not known."""
    here: str | None = None
    """The resource it has; None if it has none."""
    came_s: float = 0.0
    """Since when it has the resource."""
    stops: tuple[PlannedStop, ...] = ()
    """Its next stops, ordered by time, without a stop where it is already."""
    passages: Mapping[str, ZonePassage] = field(default_factory=dict)
    """By zone id."""

    def is_inside(self, zone: str, now_s: float) -> bool:
        """Whether a part of it is in a zone."""
        passage = self.passages.get(zone)
        return passage is not None and passage.is_inside(now_s)

    def was_in(self, place: str) -> bool:
        """Whether it had a resource, or a part of it was in a zone, at its newest report."""
        passage = self.passages.get(place)
        return passage.was_inside if passage else self.here == place

    @property
    def on_foot(self) -> bool:
        """Whether it is a person on foot, who goes around what stands, and of whom nothing is asked."""
        return self.participant == "person"

    @property
    def speed_mps(self) -> float:
        """Along its path; walking pace if it is not forecast to move."""
        return max(self.way_m / (STEPS * STEP_S), 0.2) if self.goes else 1.0


FirstFields = tuple[str, str, str, bool, float, ParticipantKind]
"""The fields of a view from `vendor` to `participant`."""


def first_fields(batch: Batch) -> Iterator[FirstFields]:
    """Those of each robot of a batch."""
    trains = set(rows_of_trains(batch.forecasts))
    pulls_trailers = (row in trains for row in range(len(batch)))
    texts = batch.vendors, batch.names, batch.states
    return zip(*texts, pulls_trailers, batch.reports_within_s.tolist(), batch.participants, strict=True)
