import json
from collections.abc import Iterator
from math import cos, pi, sin
from random import Random

import msgspec
import pytest
from msgspec.structs import replace

from ingest.fast_path import loader
from ingest.fast_path.status_scanner import letters, points
from ingest.languages.massrobotics import fast_decoder, parser, path_points
from ingest.languages.massrobotics.conformance_rules import Findings, RejectedError
from ingest.languages.massrobotics.parser import Status
from ingest.languages.massrobotics.path_points import Path, Points
from ingest.languages.massrobotics.report_models import PredictedLocation
from tests.helpers.saying import HALL, robot, stamp
from tests.helpers.vectors import VECTORS, T, Vector, at, said

OFFSETS = ("Z", "Z", "Z", "+00:00", "+0000", "", "-00:00", "+01:00", "z")
DATUMS = ("", "", '"planarDatumUUID":"Hall",', '"planarDatum":"","planarDatumUUID":"Yard",', '"planarDatum":"hall",')


def number(random: Random, most: float) -> str:
    value = random.uniform(-most, most)
    shown = repr(value), f"{value:.{random.randint(1, 20)}f}", f"{value:.3f}", f"{value:.0f}", "-0.0", f"{value:.2e}"
    return random.choices(shown, (3, 3, 5, 1, 1, 0.05))[0]


def turned(random: Random) -> str:
    half_rad, digits = random.uniform(-pi, pi) / 2, random.choice((4, 6, 17))
    parts = {"x": "0", "y": random.choice(("0", "0.0", "-0.0")), "z": sin(half_rad), "w": cos(half_rad)}
    told = (f'"{key}":{value if isinstance(value, str) else round(value, digits)}' for key, value in parts.items())
    return f"{{{', '.join(told)}}}"


def made(random: Random) -> bytes:
    """The points of a path as some sender may write them; most of them plain."""
    offset, datum, digits = random.choice(OFFSETS), random.choice(DATUMS), random.choice((0, 3, 3, 6, 9))
    written, t_s = [], random.uniform(0, 4.1e9)
    for ahead_s in range(random.randint(1, 12)):
        whole, fraction = stamp(t_s + ahead_s)[:19], f"{random.randrange(10**9):09}"[:digits]
        parts = [
            f'"timestamp":"{whole}{"." if digits else ""}{fraction}{offset}"',
            f'"x":{number(random, 300)}',
            f'"y" : {number(random, 300)}',
            f'"angle":{turned(random)}',
        ]
        if random.random() < 0.2:
            parts.append(f'"z":{number(random, 10)}')
        if random.random() < 0.2:
            random.shuffle(parts)
        written.append(f"{{{datum}{','.join(parts)}}}")
    return f"[{', '.join(written)}]".encode()


def damaged(raw: bytes, random: Random) -> bytes:
    changed = bytearray(raw)
    for _ in range(random.randint(1, 2)):
        where, letter = random.randrange(len(changed)), random.choice(b'0123456789.-+eE"\\,:{}[] \n\x00\xff\xc3aZ')
        changed[where : where + random.randint(0, 1)] = bytes((letter,)) * random.randint(0, 1)
    return bytes(changed)


def read(told: Points | list[PredictedLocation]) -> tuple[str, Findings]:
    findings: Findings = {}
    return repr(rowwise(path_points.path(told, T, findings))), findings


def rowwise(path: Path) -> Path:
    return replace(path, poses=tuple(map(tuple, path.rows)))


def agrees(raw: bytes) -> bool:
    """Whether the points are taken; then they are what msgspec and Python make of them."""
    told = points(raw)
    if told is None:
        return False
    decoded = fast_decoder._points(msgspec.Raw(raw))
    assert isinstance(decoded, list)
    assert read(told) == read(decoded)
    return True


@pytest.fixture(autouse=True)
def _not_quickened(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loader, "points", None)
    monkeypatch.setattr(loader, "letters", None)
    monkeypatch.setattr(loader, "placed", None)


def made_status(random: Random) -> bytes:
    """A status as some sender may write it; most of them plain."""
    odd = random.random() < 0.3
    known = ["navigating", "idle", "offline", "Moving", "dancing"][: 5 if odd else 3]
    digits, offset = random.choice((0, 3, 9)), random.choice(OFFSETS)
    fraction = f".{random.randrange(10**9):09}"[: digits + bool(digits)]
    where = f'"x":{number(random, 300)},"y":{number(random, 300)},"z":{number(random, 3)},"angle":{turned(random)}'
    datum = random.choice(('"planarDatum"', '"planarDatumUUID"')) + ":" + random.choice(('"Hall"', f'"{HALL}"', '""'))
    parts = [
        f'"uuid":"{random.choice((robot("A"), robot("A").upper(), "A"))}"',
        f'"timestamp":"{stamp(random.uniform(0, 4.1e9))[:19]}{fraction}{offset}"',
        f'"operationalState":"{random.choice(known)}"',
        f'"location":{{{where}{random.choice(("", "," + datum))}}}',
    ]
    angular = random.choice(("", f',"angular":{turned(random)}'))
    amount = random.uniform(-5, 130) if odd else random.choice((0, 1, 42.5, 100))
    parts += random.sample(
        [
            f'"velocity":{{"linear":{number(random, 101 if odd else 5)}{angular}}}',
            f'"batteryPercentage":{amount}',
            f'"remainingRunTime":{amount}',
            f'"loadPercentageStillAvailable" : {amount}',
            f'"errorCodes":[{random.choice(("", " ", chr(34) + "E1" + chr(34))) if odd else ""}]',
            f'"path": {made(random).decode()}',
            f'"destinations":{random.choice(("[]", made(random).decode()))}',
            '"mood":"good"' if odd else '"remainingRunTime":0.5',
        ],
        random.randint(0, 8 if odd else 7),
    )
    if random.random() < 0.5:
        random.shuffle(parts)
    return f"{{{', '.join(parts)}}}".encode()


def status(raw: bytes, names_as_uuid: str | None = None) -> Status | None:
    told = letters(raw)
    return told.status(names_as_uuid) if told else None


def status_agrees(raw: bytes) -> bool:
    """Whether the status is taken; then it is what is made of it otherwise."""
    try:
        told = status(raw, "Alder")
    except RejectedError:
        told = None
    expected = parser.read(raw, names_as_uuid="Alder")
    if told is None:
        return False
    assert isinstance(expected, Status)
    assert repr(rowwise_status(told)) == repr(rowwise_status(expected))
    return True


def rowwise_status(one: Status) -> Status:
    return replace(one, path=rowwise(one.path), destinations=rowwise(one.destinations))


def test_a_status_is_read_as_it_is_otherwise() -> None:
    random = Random(5)
    taken = sum(status_agrees(made_status(random)) for _ in range(3000))
    assert 500 < taken < 2500


def test_a_damaged_status_is_read_as_it_would_be_or_left_alone() -> None:
    random = Random(6)
    sound = [raw for raw in (made_status(random) for _ in range(400)) if status_agrees(raw)]
    taken = sum(status_agrees(damaged(random.choice(sound), random)) for _ in range(10_000))
    assert taken > 500


@pytest.mark.parametrize("key", ["uuid", "timestamp", "operationalState", "location", "velocity", "mood"])
def test_a_status_that_lacks_what_it_needs_or_says_something_twice_is_left_alone(key: str) -> None:
    sound = said(velocity={"linear": 1.0})
    assert status(sound)
    told = json.loads(sound)
    again = json.dumps({key: told.get(key, "good")})[1:-1]
    assert status(sound.replace(b"{", b"{" + again.encode() + b",", 1)) is None
    if key not in ("velocity", "mood"):
        assert status(json.dumps({name: told[name] for name in told if name != key}).encode()) is None


def test_points_are_read_as_msgspec_and_python_read_them() -> None:
    random = Random(3)
    taken = sum(agrees(made(random)) for _ in range(4000))
    assert 1000 < taken < 3500


def test_damaged_points_are_read_as_they_would_be_or_left_alone() -> None:
    random = Random(4)
    sound = [raw for raw in (made(random) for _ in range(200)) if points(raw)]
    taken = sum(agrees(damaged(random.choice(sound), random)) for _ in range(20_000))
    assert taken > 1000


@pytest.mark.parametrize(
    "value",
    [
        "0.1",
        "1e7",
        "9007199254740993.5",
        "0.30000000000000004",
        "123456.78901234567",
        "8.98846567431158e3",
        "0.5000000000000001110",
    ],
)
def test_a_number_is_the_double_nearest_to_it_or_left_alone(value: str) -> None:
    raw = json.dumps([at(T, x=0.0)]).replace('"x": 0.0, "y": 4', f'"x": {value}, "y": 4').encode()
    told = points(raw)
    assert told is None or told.path.rows[0][1] == float(value)


def days() -> Iterator[str]:
    for year in (1969, 1970, 1972, 1999, 2000, 2023, 2024, 2099, 2100):
        for month in range(14):
            yield from (f"{year}-{month:02}-{day:02}" for day in (0, 1, 27, 28, 29, 30, 31, 32))


def test_a_date_is_the_day_that_the_calendar_has() -> None:
    raw = json.dumps([at(T)]).replace(stamp(T)[:10], "DAY")
    assert sum(agrees(raw.replace("DAY", day).encode()) for day in days()) > 400


@pytest.mark.parametrize("raw", [b"", b"[]", b"[", b"[{", b"{}", b"null", b'[{"x":1}]', b"[" * 1000])
def test_what_are_no_points_is_left_alone(raw: bytes) -> None:
    assert points(raw) is None


def test_points_on_two_datums_and_more_than_are_used_are_left_alone() -> None:
    assert points(json.dumps([at(T + i, planarDatum="hall") for i in range(200)]).encode())
    assert points(json.dumps([at(T + i) for i in range(201)]).encode()) is None
    assert points(json.dumps([at(T, planarDatum="hall"), at(T + 1)]).encode()) is None
    assert points(json.dumps([at(T, planarDatum="hall"), at(T + 1, planarDatum="Hall")]).encode()) is None


@pytest.mark.parametrize("vector", VECTORS, ids=lambda one: one.name)
def test_every_message_is_read_as_before_once_that_is_quickened(vector: Vector) -> None:
    before = parser.read(vector.raw)
    loader.load()
    after = parser.read(vector.raw)
    assert repr(rowwise_status(after) if isinstance(after, Status) else after) == repr(before)


@pytest.mark.parametrize("ahead_s", [[1.0, 2.0], [2000.0, 2001.0], [-5.0, -4.0], [0.5, 20.0]])
def test_destinations_and_paths_in_arrays_are_judged_as_in_rows(ahead_s: list[float]) -> None:
    raw = json.dumps([at(T + one) for one in ahead_s]).encode()
    told, findings = points(raw), dict[str, Findings]()
    assert told
    decoded = fast_decoder._points(msgspec.Raw(raw))
    for name, given in (("array", told), ("rows", decoded)):
        findings[name] = {}
        path_points.path(given, T, findings[name])
        path_points.destinations(given, T, findings[name])
    assert findings["array"] == findings["rows"]
