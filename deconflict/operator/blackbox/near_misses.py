"""Near misses by the robots' own reports, and the delay that would have avoided each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from deconflict.foresight.near_misses.near_events import NearEvent, event_at
from deconflict.foresight.near_misses.recorded_track import RecordedTrack
from deconflict.foresight.near_misses.warning_before import (
    Lead,
    StoodAdvisory,
    lead_of,
    stood_advisories,
    warning_before,
)
from deconflict.operator.blackbox.blackbox_request import KnownNearMiss, NearPair
from deconflict.operator.blackbox.hindsight import (
    LONGEST_S,
    avoiding_delays_s,
    row_at,
)
from deconflict.settings.site import Site
from deconflict.sweep.shapes.shape_encounters import encounter
from deconflict_client.advisory import ConflictAdvisory
from ingest.batch import Forecasts
from ingest.languages import timestamps


@dataclass(frozen=True, slots=True)
class NearMiss:
    """Two robots that were within the clearance by their own reports."""

    robots: tuple[str, str]
    names: tuple[str, str]
    vendors: tuple[str, str]
    clearance_m: float
    event: NearEvent
    place: tuple[str, float, float]
    """Datum, x and y in metres, midway between the envelopes at the nearest approach."""
    avoiding_s: tuple[float | None, float | None]
    """The least delay of each robot alone that would have avoided it; None if no delay would."""
    warning: StoodAdvisory | None
    """The advisory that warned of it; None if there was none."""

    @property
    def lead(self) -> Lead | None:
        """How long before the near miss the advisory was raised; None without one."""
        return lead_of(self.warning, self.event.began_s)

    def document(self) -> dict[str, Any]:
        """The near miss for the file, the register and the API."""
        (datum, x_m, y_m), lead = self.place, self.lead
        delays = zip(self.robots, self.names, self.avoiding_s, strict=True)
        return {
            "robots": list(self.robots),
            "names": list(self.names),
            "vendors": list(self.vendors),
            "at": timestamps.write(self.event.began_s),
            "nearest_at": timestamps.write(self.event.at_s),
            "separation_m": round(self.event.separation_m, 3),
            "clearance_m": self.clearance_m,
            "location": {"datum": datum, "x": round(x_m, 3), "y": round(y_m, 3)},
            "advisory": self.warning.id if self.warning else None,
            "warned_s": round(lead.raised_s, 3) if lead else None,
            "avoided_by": [
                {"robot": uuid, "name": name, "later_s": delay_s}
                for uuid, name, delay_s in delays
                if delay_s is not None
            ],
            "summary": self.summary(),
        }

    def summary(self) -> str:
        """One sentence for a person."""
        separation_m, names = self.event.separation_m, " and ".join(self.names)
        met = f"{names} came within {separation_m:.2f} m" if separation_m else f"The envelopes of {names} overlapped"
        warned = _warned(self.lead)
        delays = [
            (delay_s, name) for delay_s, name in zip(self.avoiding_s, self.names, strict=True) if delay_s is not None
        ]
        if delays:
            least_s, name = min(delays)
            avoided = f"A delay of {least_s:g} s for {name} would have avoided it."
        else:
            avoided = f"No delay of up to {LONGEST_S:g} s for one robot would have avoided it."
        return f"{met}. {warned} {avoided}"


def verified_near_miss(
    pair: NearPair,
    tracks: Mapping[str, RecordedTrack],
    floors: Sequence[str],
    site: Site,
    published: Iterable[ConflictAdvisory],
    until_s: float,
) -> NearMiss | None:
    """The near miss of a pair that the engine noticed; None if by their reports the two kept the clearance.

    `tracks` has the reports until `until_s`, `floors` the datums of the floors in them, and `published` the revisions
    of advisories in the order of time.
    """
    if not tracks.keys() >= {pair.a, pair.b}:
        return None
    clearance_m, track_a, track_b = site.conflict.clearance_m, tracks[pair.a], tracks[pair.b]
    a, b = track_a.forecasts(), track_b.forecasts()
    event = event_at(a, b, clearance_m, pair.at_s, until_s)
    if event is None:
        return None
    return NearMiss(
        robots=(pair.a, pair.b),
        names=(track_a.name, track_b.name),
        vendors=(track_a.vendor, track_b.vendor),
        clearance_m=clearance_m,
        event=event,
        place=_place(a, b, event.at_s, floors),
        avoiding_s=avoiding_delays_s(a, b, clearance_m, event.at_s),
        warning=warning_before(stood_advisories(published, (pair.a, pair.b)), event.began_s),
    )


def one_for_each_event(misses: Iterable[NearMiss], known: Iterable[KnownNearMiss]) -> list[NearMiss]:
    """The near misses that are events of their own, ordered by time. `known` are in an earlier box.

    The engine notices an approach again once its forecasts have drawn apart meanwhile.
    """
    taken, found = list(known), list[NearMiss]()
    for miss in sorted(misses, key=lambda miss: (miss.event.began_s, miss.robots)):
        event = miss.event
        if not any(each.robots == miss.robots and event.began_s <= each.nearest_s <= event.ended_s for each in taken):
            found.append(miss)
            taken.append(KnownNearMiss(miss.robots, event.at_s))
    return found


def _warned(lead: Lead | None) -> str:
    if lead is None:
        return "No advisory was raised before."
    cleared = "" if lead.cleared_s is None else f", and cleared {lead.cleared_s:.1f} s before"
    return f"The advisory was raised {lead.raised_s:.1f} s before{cleared}."


def _place(a: Forecasts, b: Forecasts, at_s: float, floors: Sequence[str]) -> tuple[str, float, float]:
    meeting = encounter((a, row_at(a, at_s)), (b, row_at(b, at_s)), at_s)
    return floors[meeting.floor], meeting.x_m, meeting.y_m
