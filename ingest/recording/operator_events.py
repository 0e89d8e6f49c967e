"""What a log has of people: what they said of robots."""

from dataclasses import dataclass
from typing import Any

import msgspec


@dataclass(frozen=True, slots=True)
class Given:
    """A person gave a robot to a vendor."""

    uuid: str
    vendor: str


class OffFloorMark(msgspec.Struct, frozen=True, gc=False):
    """A person said that a robot is off the floor, or on it; or it was heard elsewhere since, and is back."""

    uuid: str
    at_s: float
    is_off: bool
    by: str = ""
    """Who said that it is off the floor, or put it back."""
    datum: str = ""
    """Where it was: the floor, "" for one that is compared with no other."""
    x_m: float = 0.0
    y_m: float = 0.0


def operator_event(document: dict[str, Any], at_s: float) -> Given | OffFloorMark:
    """The event of a line of the log. Raises `msgspec.ValidationError`."""
    if "given" in document:
        return msgspec.convert(document, Given)
    return msgspec.convert(document | {"at_s": at_s}, OffFloorMark)
