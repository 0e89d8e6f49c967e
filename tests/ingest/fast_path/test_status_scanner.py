import json
from collections.abc import Iterator
from math import cos, pi, sin
from random import Random

import pytest

from ingest.fast_path.status_scanner import scan
from ingest.languages.massrobotics import parser
from ingest.languages.model import Status
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
    written = (f'"{key}":{value if isinstance(value, str) else round(value, digits)}' for key, value in parts.items())
    return f"{{{', '.join(written)}}}"


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


def is_scanned(raw: bytes) -> bool:
    """Whether a status is plain; then the scanner reads the same from it as the parser."""
    scanned = scan(raw)
    if scanned is None:
        return False
    assert repr(scanned.message("Alder")) == repr(parser.read(raw, names_as_uuid="Alder"))
    return True


def with_path(points: bytes) -> bytes:
    return b'{"path": ' + points + b"," + said().removeprefix(b"{")


def path_is_scanned(points: bytes) -> bool:
    return is_scanned(with_path(points))


def test_a_plain_status_is_read_as_the_parser_reads_it() -> None:
    random = Random(5)
    taken = sum(is_scanned(made_status(random)) for _ in range(3000))
    assert 500 < taken < 2500


def test_a_damaged_status_is_read_as_the_parser_reads_it_or_left_to_it() -> None:
    random = Random(6)
    sound = [raw for raw in (made_status(random) for _ in range(400)) if is_scanned(raw)]
    taken = sum(is_scanned(damaged(random.choice(sound), random)) for _ in range(10_000))
    assert taken > 500


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector.name)
def test_every_deviation_from_the_standard_is_read_as_the_parser_reads_it(vector: Vector) -> None:
    is_scanned(vector.raw)


@pytest.mark.parametrize("key", ["uuid", "timestamp", "operationalState", "location", "velocity", "mood"])
def test_a_status_that_lacks_a_needed_key_or_has_a_key_twice_is_left_to_the_parser(key: str) -> None:
    sound = said(velocity={"linear": 1.0})
    assert is_scanned(sound)
    document = json.loads(sound)
    again = json.dumps({key: document.get(key, "good")})[1:-1]
    assert not is_scanned(sound.replace(b"{", b"{" + again.encode() + b",", 1))
    if key not in ("velocity", "mood"):
        assert not is_scanned(json.dumps({name: document[name] for name in document if name != key}).encode())


def test_a_status_whose_uuid_is_a_name_is_rejected_as_the_parser_rejects_it() -> None:
    raw = said(uuid="A")
    scanned = scan(raw)
    assert scanned
    assert isinstance(scanned.message("Alder"), Status)
    assert repr(scanned.message(None)) == repr(parser.read(raw))


def test_points_are_read_as_the_parser_reads_them() -> None:
    random = Random(3)
    taken = sum(path_is_scanned(made(random)) for _ in range(4000))
    assert 1000 < taken < 3500


def test_damaged_points_are_read_as_the_parser_reads_them_or_left_to_it() -> None:
    random = Random(4)
    sound = [points for points in (made(random) for _ in range(200)) if path_is_scanned(points)]
    taken = sum(path_is_scanned(damaged(random.choice(sound), random)) for _ in range(20_000))
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
def test_a_number_is_the_double_nearest_to_it_or_left_to_the_parser(value: str) -> None:
    points = json.dumps([at(T, x=0.0)]).replace('"x": 0.0, "y": 4', f'"x": {value}, "y": 4').encode()
    scanned = scan(with_path(points))
    if scanned:
        message = scanned.message(None)
        assert isinstance(message, Status)
        assert message.path.poses[0][1] == float(value)


def days() -> Iterator[str]:
    for year in (1969, 1970, 1972, 1999, 2000, 2023, 2024, 2099, 2100):
        for month in range(14):
            yield from (f"{year}-{month:02}-{day:02}" for day in (0, 1, 27, 28, 29, 30, 31, 32))


def test_a_date_is_the_day_that_the_calendar_has() -> None:
    points = json.dumps([at(T)]).replace(stamp(T)[:10], "DAY")
    assert sum(path_is_scanned(points.replace("DAY", day).encode()) for day in days()) > 400


@pytest.mark.parametrize("points", [b"", b"[", b"[{", b"{}", b"null", b'[{"x":1}]', b"[" * 1000])
def test_text_that_is_no_array_of_points_is_left_to_the_parser(points: bytes) -> None:
    assert not path_is_scanned(points)


def test_points_on_two_datums_and_more_than_are_used_are_left_to_the_parser() -> None:
    assert path_is_scanned(json.dumps([at(T + i, planarDatum="hall") for i in range(200)]).encode())
    assert not path_is_scanned(json.dumps([at(T + i) for i in range(201)]).encode())
    assert not path_is_scanned(json.dumps([at(T, planarDatum="hall"), at(T + 1)]).encode())
    assert not path_is_scanned(json.dumps([at(T, planarDatum="hall"), at(T + 1, planarDatum="Hall")]).encode())


@pytest.mark.parametrize("key", ["path", "destinations"])
@pytest.mark.parametrize("ahead_s", [[1.0, 2.0], [2000.0, 2001.0], [-5.0, -4.0], [0.5, 20.0]])
def test_times_of_points_are_judged_as_the_parser_judges_them(key: str, ahead_s: list[float]) -> None:
    assert is_scanned(said(**{key: [at(T + later_s) for later_s in ahead_s]}))
