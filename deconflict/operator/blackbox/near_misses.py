"""Near misses by the robots' own reports, and the delay that would have avoided each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

from deconflict.operator.blackbox.blackbox_request import KnownNearMiss, NearPair
from deconflict.operator.blackbox.hindsight import (
    LONGEST_S,
    NearestApproach,
    RecordedTrack,
    avoiding_delays_s,
    nearest_approach,
    row_at,
)
from deconflict.settings.site import Site
from deconflict.sweep.shapes.shape_encounters import encounter
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from ingest.batch import Forecasts
from ingest.languages import timestamps

LONGEST_AFTER_S = 30.0
"""The nearest approach is at most this long after the engine noticed the pair."""
LONGEST_BEFORE_S = 3.0
"""A near miss began at most this long before the engine noticed it."""
APART_S = 3.0
"""A pair that comes within the clearance this long after its nearest approach has met again."""


@dataclass(frozen=True, slots=True)
class NearMiss:
    """Two robots that were within the clearance by their own reports."""

    robots: tuple[str, str]
    names: tuple[str, str]
    vendors: tuple[str, str]
    clearance_m: float
    nearest: NearestApproach
    place: tuple[str, float, float]
    """Datum, x and y in metres, midway between the envelopes at the nearest approach."""
    avoiding_s: tuple[float | None, float | None]
    """The least delay of each robot alone that would have avoided it; None if no delay would."""
    advisory: str | None
    """Id of the advisory that was open when the near miss began; None if there was none."""
    warned_s: float | None
    """How long before the near miss the advisory was raised; None without an advisory."""

    def document(self) -> dict[str, Any]:
        """The near miss for the file, the register and the API."""
        datum, x_m, y_m = self.place
        delays = zip(self.robots, self.names, self.avoiding_s, strict=True)
        return {
            "robots": list(self.robots),
            "names": list(self.names),
            "vendors": list(self.vendors),
            "at": timestamps.write(self.nearest.began_s),
            "nearest_at": timestamps.write(self.nearest.at_s),
            "separation_m": round(self.nearest.separation_m, 3),
            "clearance_m": self.clearance_m,
            "location": {"datum": datum, "x": round(x_m, 3), "y": round(y_m, 3)},
            "advisory": self.advisory,
            "warned_s": None if self.warned_s is None else round(self.warned_s, 3),
            "avoided_by": [
                {"robot": uuid, "name": name, "later_s": delay_s}
                for uuid, name, delay_s in delays
                if delay_s is not None
            ],
            "summary": self.summary(),
        }

    def summary(self) -> str:
        """One sentence for a person."""
        separation_m, names = self.nearest.separation_m, " and ".join(self.names)
        met = f"{names} came within {separation_m:.2f} m" if separation_m else f"The envelopes of {names} overlapped"
        warned = (
            "No advisory was raised before."
            if self.warned_s is None
            else f"The advisory was raised {self.warned_s:.1f} s before."
        )
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
    decided: Sequence[ConflictAdvisory],
    until_s: float,
) -> NearMiss | None:
    """The near miss of a pair that the engine noticed; None if by their own reports they kept the clearance."""
    if not tracks.keys() >= {pair.a, pair.b}:
        return None
    clearance_m, track_a, track_b = site.conflict.clearance_m, tracks[pair.a], tracks[pair.b]
    a, b = track_a.forecasts(), track_b.forecasts()
    begin_s, end_s = pair.at_s - LONGEST_BEFORE_S, min(pair.at_s + LONGEST_AFTER_S, until_s)
    nearest = nearest_approach(a, b, clearance_m, begin_s, end_s)
    if nearest is None:
        return None
    advisory = _open_advisory(pair, nearest.began_s, decided)
    return NearMiss(
        robots=(pair.a, pair.b),
        names=(track_a.name, track_b.name),
        vendors=(track_a.vendor, track_b.vendor),
        clearance_m=clearance_m,
        nearest=nearest,
        place=_place(a, b, nearest.at_s, floors),
        avoiding_s=avoiding_delays_s(a, b, clearance_m, nearest.at_s),
        advisory=advisory.id if advisory else None,
        warned_s=nearest.began_s - advisory.raised_at.timestamp() if advisory else None,
    )


def one_for_each_event(misses: Iterable[NearMiss], known: Iterable[KnownNearMiss]) -> list[NearMiss]:
    """The near misses that are events of their own, ordered by time. `known` are in an earlier box.

    The engine notices an approach again once its forecasts have drawn apart meanwhile. What begins before a pair has
    been apart for `APART_S` is the same event.
    """
    nearest_s: dict[tuple[str, str], float] = {}
    for near_miss in known:
        nearest_s[near_miss.robots] = max(near_miss.nearest_s, nearest_s.get(near_miss.robots, -inf))
    found = []
    for miss in sorted(misses, key=lambda miss: (miss.nearest.began_s, miss.robots)):
        last_s = nearest_s.get(miss.robots, -inf)
        if miss.nearest.began_s > last_s + APART_S:
            found.append(miss)
        nearest_s[miss.robots] = max(miss.nearest.at_s, last_s)
    return found


def _open_advisory(pair: NearPair, at_s: float, decided: Sequence[ConflictAdvisory]) -> ConflictAdvisory | None:
    """The newest revision of the pair's advisory at a time; None if there was none or it was cleared."""
    revisions = [
        advisory
        for advisory in decided
        if advisory.robots == (pair.a, pair.b) and advisory.updated_at.timestamp() <= at_s
    ]
    return revisions[-1] if revisions and revisions[-1].state is not AdvisoryState.CLEARED else None


def _place(a: Forecasts, b: Forecasts, at_s: float, floors: Sequence[str]) -> tuple[str, float, float]:
    meeting = encounter((a, row_at(a, at_s)), (b, row_at(b, at_s)), at_s)
    return floors[meeting.floor], meeting.x_m, meeting.y_m
