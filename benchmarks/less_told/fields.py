"""The optional fields of each language, and the comparisons with and without each."""

from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from types import MappingProxyType
from typing import NamedTuple

Fields = frozenset[str]

FIELDS: Mapping[str, Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "massrobotics": {
            "angle": (),
            "velocity": (),
            "angular": ("velocity",),
            "path": (),
            "path_angle": ("path",),
            "destination": (),
            "destination_time": ("destination",),
            "identity": (),
            "max_speed": ("identity",),
        },
        "vda5050": {
            "theta": (),
            "velocity": (),
            "omega": ("velocity",),
            "factsheet": (),
            "speed_max": ("factsheet",),
            "order": (),
            "horizon": ("order",),
            "node_theta": ("order",),
            "edge_max_speed": ("order",),
            "edge_max_rotation": ("order",),
            "intermediate_path": (),
        },
        "iso21423": {
            "yaw": (),
            "velocity": (),
            "angular": ("velocity",),
            "footprint": (),
            "rated_speed": (),
            "trajectory": (),
            "plan": (),
            "states": (),
        },
    }
)
"""By language, each field and the fields that it needs."""


PATHS = frozenset(("path", "intermediate_path", "trajectory"))
"""Fields that say where a robot will be and when. Beside one of them the others count for little."""


class Comparison(NamedTuple):
    """One field: what robots report with it, and what without it."""

    field: str
    beside: str
    """`all` other fields, `all but a path`, or `none` but those that it needs."""
    having: Fields
    lacking: Fields


def comparisons(language: str) -> Iterator[Comparison]:
    """Each field taken from all fields, with a path and without one, and each added to nothing."""
    fields = FIELDS[language]
    every = frozenset(fields)
    pathless = every - _and_dependent(fields, PATHS)
    for field, needs in fields.items():
        dependent = _and_dependent(fields, {field})
        yield Comparison(field, "all", every, every - dependent)
        if field in pathless:
            yield Comparison(field, "all but a path", pathless, pathless - dependent)
        yield Comparison(field, "none", frozenset({field, *needs}), frozenset(needs))


def _and_dependent(fields: Mapping[str, tuple[str, ...]], some: AbstractSet[str]) -> Fields:
    """Some fields, and those that need one of them."""
    return frozenset(some).union(field for field, needs in fields.items() if some & set(needs))


def variants(language: str) -> list[Fields]:
    """The different sets of fields of all comparisons, the fullest first."""
    found = {fields for comparison in comparisons(language) for fields in (comparison.having, comparison.lacking)}
    return sorted(found, key=lambda fields: (-len(fields), sorted(fields)))
