"""Whatever the parts of learned state are like, the engine goes on, and with no part that is not as it was written."""

import json
from collections.abc import Callable, Mapping
from functools import cache, partial
from io import BytesIO
from math import pi
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest

from deconflict.engine.engine import Engine
from deconflict.runtime.learned_state import FORM, HEAD, Part, packed, unpacked
from deconflict.settings.shared_places import Resource
from deconflict_client.advisory import ConflictAdvisory
from tests.deconflict.engine.learned.json_damages import json_damages
from tests.deconflict.engine.made_engine import SITE, Course, Floor
from tests.helpers.saying import HALL

KEPT_OF_A_FIRST_RELEASE = Path(__file__).parent / "learned_without_statements.npz"
CORNERS = [[-31, 19], [-29, 19], [-29, 21], [-31, 21]]
DOCK = Resource.model_validate({"id": "dock", "kind": "dock", "datum": HALL, "polygon": CORNERS})
FLOOR_SITE = SITE.model_copy(update={"resources": (DOCK,)})


def crossing(at: float, direction: float) -> Course:
    """Through the middle of the floor again and again, with a wait at each end."""

    def course(t: float) -> tuple[float, float, float]:
        part = (t + at) % 40
        along = min(part, 15.0) - 7.5 if part < 20 else 7.5 - min(part - 20, 15.0)
        yaw = direction + (pi if part >= 20 else 0.0)
        return along * np.cos(direction), along * np.sin(direction), yaw

    return course


COURSES: dict[str, Course] = {
    "A-1": crossing(0.0, 0.0),
    "C-1": crossing(0.3, pi / 2),
    "A-2": crossing(11.0, 1.0),
    "C-2": lambda _: (-30.0, 20.0, 0.0),
}
MAKERS = {"A-1": "Alder", "A-2": "Alder", "C-1": "Corvid", "C-2": "Corvid"}


def floor_with(learned: Mapping[str, Part] | None) -> Floor:
    floor = Floor(dict(COURSES), makers=dict(MAKERS), site=FLOOR_SITE)
    floor.engine = Engine(FLOOR_SITE, learned=learned)
    return floor


@pytest.fixture(scope="module")
def saved() -> bytes:
    """The state of an engine whose robots have met for three minutes."""
    floor = floor_with(None)
    floor.run(180)
    return packed(floor.engine.learned())


def outcome(learned: Mapping[str, Part] | None) -> tuple[list[str], list[Any], dict[str, str]]:
    """What an engine says that goes on with this, its probabilities, and the parts that it has set aside."""
    floor = floor_with(learned)
    set_aside = floor.engine.set_aside
    revisions = floor.run(12)
    floor.engine.presence_document(0.0)
    json.dumps(floor.engine.measures.as_document())
    return [_text(revision) for revision in revisions], floor.engine.probabilities(), set_aside


def _text(revision: ConflictAdvisory) -> str:
    return revision.model_dump_json(exclude={"id"})


Arrays = dict[str, Any]


class Damage(Protocol):
    """Damages an array of a file."""

    __name__: str

    def __call__(self, arrays: Arrays, name: str) -> None: ...


def dropped(arrays: Arrays, name: str) -> None:
    del arrays[name]


def renamed(arrays: Arrays, name: str) -> None:
    arrays[f"{name}_of_all"] = arrays.pop(name)


def exchanged(arrays: Arrays, name: str) -> None:
    """Another array of the file has this name."""
    others = [other for other in arrays if other not in (name, HEAD)]
    arrays[name] = arrays[others[(others.index(others[-1]) * 7 + len(name)) % len(others)]].copy()
    arrays[name] = arrays[name] + 1.0


def shortened(arrays: Arrays, name: str) -> None:
    arrays[name] = arrays[name][:-1] if arrays[name].ndim and len(arrays[name]) else np.zeros((1, 1))


def lengthened(arrays: Arrays, name: str) -> None:
    more = arrays[name][:1] if len(arrays[name]) else np.ones((1, *arrays[name].shape[1:]))
    arrays[name] = np.concatenate([arrays[name], more])


def permuted(arrays: Arrays, name: str) -> None:
    """Also changed a little, since a permutation of alike numbers changes nothing."""
    array = arrays[name] if arrays[name].size else np.ones((1, *arrays[name].shape[1:]))
    arrays[name] = np.nextafter(np.roll(array.ravel(), 1), 9.0).reshape(array.shape)


def of_another_type(arrays: Arrays, name: str) -> None:
    arrays[name] = arrays[name].astype(np.float32)


def as_text(arrays: Arrays, name: str) -> None:
    arrays[name] = np.array(["a", "b"])


def not_numbers(arrays: Arrays, name: str) -> None:
    arrays[name] = np.full_like(arrays[name], np.nan) if arrays[name].size else np.array([np.nan])


def huge(arrays: Arrays, name: str) -> None:
    arrays[name] = np.full_like(arrays[name], 1e300) if arrays[name].size else np.array([1e300])


def huge_whole_numbers(arrays: Arrays, name: str) -> None:
    arrays[name] = np.full(np.maximum(arrays[name].shape, 1), 2**62)


DAMAGES: tuple[Damage, ...] = (
    dropped, renamed, exchanged, shortened, lengthened, permuted, of_another_type, as_text, not_numbers, huge,
    huge_whole_numbers,
)  # fmt: skip


def rewritten(data: bytes, change: Callable[[Arrays], None]) -> bytes:
    """The file with changed arrays, as another program would write it."""
    with np.load(BytesIO(data)) as file:
        arrays = {name: file[name] for name in file.files}
    change(arrays)
    out = BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


def arrays_of(data: bytes) -> list[str]:
    with np.load(BytesIO(data)) as file:
        return [name for name in file.files if name != HEAD]


@cache
def expected(saved: bytes, part: str) -> tuple[list[str], list[Any]]:
    """What an engine says and computes that has learned nothing of a part."""
    return outcome({name: state for name, state in unpacked(saved).items() if name != part})[:2]


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_a_part_with_a_damaged_column_is_set_aside_as_a_whole(saved: bytes, damage: Damage) -> None:
    without: dict[str, dict[str, Part]] = {}
    for column in arrays_of(saved):
        part = column.partition(".")[0]
        damaged = unpacked(rewritten(saved, partial(damage, name=column)))
        engine = Engine(FLOOR_SITE, learned=damaged)
        assert set(engine.set_aside) == {part}, column
        without.setdefault(part, damaged)
    for part, damaged in without.items():
        assert outcome(damaged)[:2] == expected(saved, part)


def test_no_value_of_a_part_ends_the_engine_and_none_is_taken_that_was_changed(saved: bytes) -> None:
    """A digest tells of each change in a file. Here the statement alone is to keep the engine from failing."""
    parts = unpacked(saved)
    tried = 0
    for name, part in parts.items():
        for key, value in part.items():
            if isinstance(value, np.ndarray):
                continue
            for damaged in json_damages(value):
                engine = Engine(FLOOR_SITE, learned=parts | {name: part | {key: damaged}})
                assert set(engine.set_aside) <= {name}
                assert (
                    set(engine.set_aside) == {name}
                    or damaged in ([], {}, None)
                    or isinstance(damaged, type(value) | int)
                )
                if not engine.set_aside:
                    floor = floor_with(parts | {name: part | {key: damaged}})
                    floor.run(2)
                    floor.engine.measures.as_document()
                tried += 1
    assert tried > 300


def test_a_part_from_another_save_is_not_taken(saved: bytes) -> None:
    floor = floor_with(None)
    floor.run(60)
    with np.load(BytesIO(packed(floor.engine.learned()))) as file:
        others = {name: file[name] for name in file.files if name.startswith("ledger.following")}
    mixed = unpacked(rewritten(saved, lambda arrays: arrays.update(others)))
    assert outcome(mixed)[2].keys() == {"ledger"}
    assert outcome(mixed)[:2] == expected(saved, "ledger")


@pytest.mark.parametrize("part", ["", "ledger", "calibration", "silences", "lateness", "rests"])
def test_a_part_that_is_missing_or_of_another_form_is_named(saved: bytes, part: str) -> None:
    parts = unpacked(saved)
    others = [name for name in parts if name != part]
    assert outcome({name: parts[name] for name in others})[2].keys() == ({part} if part else set())
    if part:
        of_another = parts | {part: parts[part] | {FORM: "errors by 64 bins"}}
        published, probabilities, set_aside = outcome(of_another)
        assert set_aside.keys() == {part}
        assert "errors by 64 bins" in set_aside[part]
        assert (published, probabilities) == expected(saved, part)


def test_a_part_that_only_a_newer_release_has_is_named_and_the_others_are_taken(saved: bytes) -> None:
    parts = unpacked(saved)
    assert outcome(parts | {"tides": {FORM: "tides"}})[2] == {"tides": "this release has no such part"}


def test_what_was_saved_is_taken_whole(saved: bytes) -> None:
    published, probabilities, set_aside = outcome(unpacked(saved))
    assert not set_aside
    assert (published, probabilities) != outcome(None)[:2]


def test_the_file_of_a_release_whose_parts_stated_nothing_ends_no_engine() -> None:
    """Its ledger has rows, and the release kept no errors of robots on their way, which have to have the same rows."""
    parts = unpacked(KEPT_OF_A_FIRST_RELEASE.read_bytes())
    assert "following" not in parts
    assert len(parts["ledger"]["kinds"]) > 1
    published, probabilities, set_aside = outcome(parts)
    assert {"ledger", "calibration"} <= set_aside.keys()
    assert not {"changes", "arrivals", "lateness", "stays", "rests"} & set_aside.keys()
    taken = {name: part for name, part in parts.items() if name not in set_aside}
    assert (published, probabilities) == outcome(taken)[:2]
