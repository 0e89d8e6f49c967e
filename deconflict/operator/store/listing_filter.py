"""Which advisories or situations a listing has."""

from dataclasses import dataclass
from typing import Literal

from deconflict.advisories.situations.situation import AnyRevision
from deconflict.advisory import SITUATION, AdvisoryState

StateFilter = Literal["open", "cleared", "all"]

OPEN_VALUES: dict[StateFilter, tuple[int, ...]] = {"open": (1,), "cleared": (0,), "all": (0, 1)}


@dataclass(frozen=True, slots=True)
class ListingFilter:
    """Where a field is None, any value will do."""

    state: StateFilter = "open"
    kind: str | None = None
    """None for any kind of advisory, without situations."""
    situation_kind: str | None = None
    severity: str | None = None
    vendor: str | None = None
    robot: str | None = None

    def matches(self, revision: AnyRevision) -> bool:
        return (
            int(revision.state is not AdvisoryState.CLEARED) in OPEN_VALUES[self.state]
            and (revision.kind == self.kind if self.kind else revision.kind != SITUATION)
            and self.situation_kind in (None, getattr(revision, "situation_kind", None))
            and self.severity in (None, revision.severity)
            and (self.vendor is None or self.vendor in revision.vendors)
            and (self.robot is None or self.robot in revision.robots)
        )
