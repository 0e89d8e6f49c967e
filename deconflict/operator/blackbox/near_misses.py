"""Near misses as they happened, and what would have avoided each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from deconflict.advisory import AdvisoryState, ConflictAdvisory
from deconflict.operator.blackbox.blackbox_request import Near
from deconflict.operator.blackbox.hindsight import LONGEST_S, Met, Track, avoiding_s, met, row_at
from deconflict.settings.site import Site
from deconflict.sweep.geometry.encounter import encounter
from ingest.batch import Forecasts
from ingest.languages.massrobotics import timestamps

LASTS_S = 30.0
"""How long after it was noticed a pair may come nearer still."""
NOTICED_S = 3.0
"""How long before it was noticed a near miss may have begun."""


@dataclass(frozen=True, slots=True)
class NearMiss:
    """Two robots that were within the clearance by their own reports."""

    robots: tuple[str, str]
    names: tuple[str, str]
    vendors: tuple[str, str]
    clearance_m: float
    met: Met
    place: tuple[str, float, float]
    """Datum, x and y in metres, midway between the envelopes when they were nearest."""
    avoiding_s: tuple[float | None, float | None]
    """How much later each need have been, the other being as it was; None where no delay would do."""
    advisory: str | None
    """Id of the advisory that stood when it began."""
    warned_s: float | None
    """How long before that it was raised."""

    def document(self) -> dict[str, Any]:
        """It for the file, the register and the API."""
        datum, x_m, y_m = self.place
        later = [one for one in zip(self.robots, self.names, self.avoiding_s, strict=True) if one[2] is not None]
        return {
            "robots": list(self.robots),
            "names": list(self.names),
            "vendors": list(self.vendors),
            "at": timestamps.write(self.met.began_s),
            "nearest_at": timestamps.write(self.met.at_s),
            "separation_m": round(self.met.separation_m, 3),
            "clearance_m": self.clearance_m,
            "location": {"datum": datum, "x": round(x_m, 3), "y": round(y_m, 3)},
            "advisory": self.advisory,
            "warned_s": None if self.warned_s is None else round(self.warned_s, 3),
            "avoided_by": [
                {"robot": uuid, "name": name, "later_s": later_s}
                for uuid, name, later_s in later
                if later_s is not None
            ],
            "summary": self.summary(),
        }

    def summary(self) -> str:
        """One sentence for a person."""
        how = f"within {self.met.separation_m:.2f} m" if self.met.separation_m else "into each other's envelope"
        warned = "without a warning" if self.warned_s is None else f"warned of {self.warned_s:.1f} s before"
        delays = [(one, name) for one, name in zip(self.avoiding_s, self.names, strict=True) if one is not None]
        if delays:
            least_s, name = min(delays)
            avoided = f"no conflict had {name} come {least_s:g} s later"
        else:
            avoided = f"no delay of one of them up to {LONGEST_S:g} s would have avoided it"
        return f"{' and '.join(self.names)} came {how}, {warned}; {avoided}"


def judged(
    near: Near,
    found: Mapping[str, Track],
    floors: Sequence[str],
    site: Site,
    decided: Sequence[ConflictAdvisory],
    until_s: float,
) -> NearMiss | None:
    """What became of one that the engine noticed; None where by the robots' own reports it was none."""
    if not found.keys() >= {near.a, near.b}:
        return None
    clearance_m, tracks = site.conflict.clearance_m, (found[near.a], found[near.b])
    a, b = (one.way() for one in tracks)
    how = met(a, b, clearance_m, near.at_s - NOTICED_S, min(near.at_s + LASTS_S, until_s))
    if how is None:
        return None
    advisory = _standing(near, how.began_s, decided)
    return NearMiss(
        robots=(near.a, near.b),
        names=(tracks[0].name, tracks[1].name),
        vendors=(tracks[0].vendor, tracks[1].vendor),
        clearance_m=clearance_m,
        met=how,
        place=_place(a, b, how.at_s, floors),
        avoiding_s=avoiding_s(a, b, clearance_m, how.at_s),
        advisory=advisory.id if advisory else None,
        warned_s=how.began_s - advisory.raised_at.timestamp() if advisory else None,
    )


def _standing(near: Near, at_s: float, decided: Sequence[ConflictAdvisory]) -> ConflictAdvisory | None:
    """The newest revision by then of the pair's advisory, if it was open."""
    known = [one for one in decided if one.robots == (near.a, near.b) and one.updated_at.timestamp() <= at_s]
    return known[-1] if known and known[-1].state is not AdvisoryState.CLEARED else None


def _place(a: Forecasts, b: Forecasts, at_s: float, floors: Sequence[str]) -> tuple[str, float, float]:
    meeting = encounter((a, row_at(a, at_s)), (b, row_at(b, at_s)), at_s)
    return floors[meeting.floor], meeting.x_m, meeting.y_m
