"""What is said of the worst places stands for a shift. Pure but for `StandingPlaces`, which keeps it.

At the change of shift it is made anew, from the shift that has ended. Within a shift a place is added while there are
fewer than five, and a change replaces another one only if it saves more beyond the doubt of both.
"""

from collections.abc import Sequence
from datetime import datetime, time, timedelta
from threading import Lock

from deconflict.operator.suggestions.worst_places import MOST_PLACES, SQUARE_M
from deconflict_client.answers.suggestion_models import WorstPlace


def shift_begin(now: datetime, begins: Sequence[str]) -> datetime:
    """When the shift of a local time began. `begins` are the times of day at which shifts begin, such as "06:00"."""
    days = (now - timedelta(days=1), now)
    begun = [datetime.combine(day, time.fromisoformat(clock), now.tzinfo) for day in days for clock in begins]
    return max(begin for begin in begun if begin <= now)


def standing(kept: Sequence[WorstPlace], found: Sequence[WorstPlace]) -> list[WorstPlace]:
    """What stands within a shift, of what is kept and what is found now."""
    found_at = {_key(place): place for place in found}
    stands = [_better(place, found_at.pop(_key(place), place)) for place in kept]
    return [*stands, *found_at.values()][:MOST_PLACES]


class StandingPlaces:
    """Keeps what stands. Any thread may call it."""

    def __init__(self) -> None:
        self._lock, self._shift_s = Lock(), 0.0
        self._kept: list[WorstPlace] = []

    def update(self, shift_s: float, before: Sequence[WorstPlace], found: Sequence[WorstPlace]) -> list[WorstPlace]:
        """What stands in the shift that began at `shift_s`. `before` is of the one before it, `found` of it so far."""
        with self._lock:
            if shift_s != self._shift_s:
                self._shift_s, self._kept = shift_s, list(before)
            self._kept = standing(self._kept, found)
            return list(self._kept)


def _better(kept: WorstPlace, found: WorstPlace) -> WorstPlace:
    if found.best is None or found.best.saving is None:
        return kept
    most_s = kept.best.saving.high_s_per_hour if kept.best and kept.best.saving else 0.0
    return found if found.best.saving.low_s_per_hour > most_s else kept


def _key(place: WorstPlace) -> tuple[object, ...]:
    square = () if place.place else (place.x_m // SQUARE_M, place.y_m // SQUARE_M)
    return place.floor, place.place, *square
