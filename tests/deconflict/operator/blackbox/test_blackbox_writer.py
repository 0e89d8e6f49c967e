import json
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest
import zstandard

from deconflict.foresight.near_misses.near_events import NearEvent
from deconflict.operator.blackbox.archive import Box
from deconflict.operator.blackbox.blackbox_request import KnownNearMiss
from deconflict.operator.blackbox.blackbox_writer import write_blackbox
from deconflict.operator.blackbox.hash_chain import ChainBrokenError, verified
from deconflict.operator.blackbox.keeper import known_of
from deconflict.operator.blackbox.near_misses import NearMiss, one_for_each_event
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict_client.answers.blackbox_models import KeptBlackBox
from ingest.fleet.recovery.kept_messages import KeptMessages
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_packing import LogPacker
from ingest.recording.log_reader import lines_of
from ingest.settings import RecorderSettings
from tests.deconflict.operator.blackbox.made_floor import NOW_S, Floor, crossing, lived
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import identity, robot
from tests.helpers.typed_answers import left_out


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Floor:
    """Two that pass each other at a hand's breadth after 100 s."""
    return lived(tmp_path_factory.mktemp("floor"), crossing(100.0, 1.7), 130)


@pytest.fixture(scope="module")
def box(floor: Floor) -> Box:
    made = write_blackbox(floor.order())
    assert made
    return made


def made_miss(began_s: float, nearest_s: float) -> NearMiss:
    nobody: tuple[str, str] = ("A-1", "B-1")
    event = NearEvent(began_s, nearest_s + 0.5, 0.1, nearest_s)
    return NearMiss(nobody, nobody, nobody, 0.3, event, ("hall", 0.0, 0.0), (None, None), None)


def file_of(floor: Floor, box: Box) -> Path:
    return floor.order().archive / str(box["file"])


def lines(floor: Floor, box: Box) -> list[bytes]:
    return list(lines_of(file_of(floor, box)))


def test_a_near_miss_has_its_facts_and_the_delay_that_would_have_avoided_it(box: Box) -> None:
    (miss,) = box["near_misses"]
    assert dict(zip(miss["robots"], miss["names"], strict=True)) == {
        robot("A-1"): "Alder A-1",
        robot("B-1"): "Alder B-1",
    }
    assert not left_out(KeptBlackBox, box)
    assert 0 < miss["separation_m"] < miss["clearance_m"]
    delays = {row["name"]: row["later_s"] for row in miss["avoided_by"]}
    assert 0 < delays["Alder B-1"] <= 0.5, "the one behind need have been only a little later"
    assert delays["Alder A-1"] > delays["Alder B-1"] + 1
    assert f"A delay of {delays['Alder B-1']:g} s for Alder B-1 would have avoided it." in miss["summary"]


def test_an_approach_that_the_engine_notices_twice_is_one_near_miss_and_no_other_box_has_it(
    tmp_path: Path, floor: Floor, box: Box
) -> None:
    (pair,) = floor.near
    noticed = tuple(pair._replace(at_s=pair.at_s + later_s) for later_s in (0.0, 1.0, 5.0))
    order = replace(floor.order(), archive=tmp_path, pairs=noticed)
    again = write_blackbox(order)
    assert again
    assert again["near_misses"] == box["near_misses"]
    assert write_blackbox(replace(order, known=known_of([again]))) is None


def test_what_an_earlier_box_has_of_an_event_is_not_listed_again() -> None:
    first, second = made_miss(10.0, 11.0), made_miss(15.0, 15.5)
    assert one_for_each_event([second, first, first], ()) == [first, second]
    assert one_for_each_event([second, first], [KnownNearMiss(first.robots, 10.7)]) == [second]


def test_the_stated_delay_avoids_the_near_miss_and_a_delay_one_step_shorter_does_not(tmp_path: Path, box: Box) -> None:
    later_s = {row["name"]: row["later_s"] for row in box["near_misses"][0]["avoided_by"]}["Alder B-1"]
    for delay_s, meets in ((later_s, False), (later_s - 0.1, True)):
        directory = tmp_path / str(meets)
        again = lived(directory, crossing(30.0, 1.7 + delay_s), 45)
        order = again.order() if again.near else None
        assert bool(order and write_blackbox(order)) is meets


def test_every_line_carries_the_hash_of_the_one_before(floor: Floor, box: Box) -> None:
    chain = verified(lines(floor, box))
    assert (chain.head, chain.lines > 300) == (box["sha256"], True)


@pytest.mark.parametrize("change", ["alter", "drop", "swap", "cut", "end"])
def test_a_change_is_found(floor: Floor, box: Box, change: str) -> None:
    messages = lines(floor, box)
    if change == "alter":
        messages[200] = (
            messages[200].replace(b'"linear":', b'"linear": ', 1)
            if b'"linear":' in messages[200]
            else messages[200][:-2] + b" }\n"
        )
    elif change == "drop":
        del messages[200]
    elif change == "swap":
        messages[200], messages[201] = messages[201], messages[200]
    elif change == "cut":
        messages = messages[:200]
    else:
        del messages[-1]
    with pytest.raises(ChainBrokenError):
        verified(messages)


def test_the_box_has_what_a_replay_needs_and_no_secret(floor: Floor, box: Box) -> None:
    sent = lines(floor, box)
    Site.model_validate(json.loads(sent[0])["blackbox"]["site"])
    assert b"ALDER_TOKEN" not in sent[0]
    assert b"10.0.0.1" not in sent[0]
    messages = [document["message"] for line in sent if "message" in (document := json.loads(line))]
    identified = {message["uuid"] for message in messages if "robotSerialNumber" in message}
    assert identified == {robot("A-1"), robot("B-1"), robot("C-1")}, "said long before the box begins"


def test_the_next_box_continues_the_chain_of_the_last(tmp_path: Path) -> None:
    floor = lived(tmp_path, crossing(60.0, 1.7), 80)
    first, second = write_blackbox(floor.order()), write_blackbox(floor.order())
    assert first
    assert second
    last = [file_of(floor, document) for document in (first, second)][-1]
    assert json.loads(next(lines_of(last)))["before"] == first["sha256"]


def test_robots_that_kept_the_clearance_by_their_reports_have_no_box(floor: Floor) -> None:
    order = floor.order()
    far = tuple(pair._replace(a=robot("A-1"), b=robot("C-1")) for pair in order.pairs)
    assert write_blackbox(replace(order, pairs=far)) is None


def test_a_torn_line_of_the_log_is_left_out(tmp_path: Path) -> None:
    floor = lived(tmp_path, crossing(60.0, 1.7), 80)
    (log,) = (tmp_path / "log").iterdir()
    whole = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join([*whole[:-3], b'{"received":"2026-', b"\n", *whole[-3:]]))
    assert write_blackbox(floor.order())


def test_a_box_of_packed_segments_is_that_of_plain_ones(tmp_path: Path) -> None:
    floor = lived(tmp_path, crossing(60.0, 1.7), 80, settings=RecorderSettings(segment_bytes=20_000))
    packed = sorted((tmp_path / "log").glob("*.zst"))
    assert len(packed) > 3
    box = write_blackbox(floor.order())
    for file in packed:
        file.with_suffix("").write_bytes(b"".join(lines_of(file)))
        file.unlink()
    again = write_blackbox(floor.order())
    assert box
    assert again
    assert [unchained(line) for line in lines(floor, box)] == [unchained(line) for line in lines(floor, again)]


def test_a_damaged_packed_segment_costs_a_box_what_can_not_be_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    floor = lived(tmp_path, crossing(60.0, 1.7), 70)
    (log,) = (tmp_path / "log").iterdir()
    packer = LogPacker()
    packer.pack([log, log])
    packer.close(PATIENCE_S)
    packed = log.with_name(log.name + ".zst")
    packed.write_bytes(packed.read_bytes()[:-1] + b"x")
    assert write_blackbox(floor.order())
    assert f"{packed} is damaged" in caplog.text


def unchained(line: bytes) -> dict[str, object]:
    """A line without the hash of the one before."""
    return {key: value for key, value in json.loads(line).items() if key != "before"}


def test_robots_that_identified_themselves_long_before_have_their_identity_in_the_box(tmp_path: Path) -> None:
    floor = lived(tmp_path, crossing(60.0, 1.7), 80)
    (log,) = (tmp_path / "log").iterdir()
    is_status = [b"operationalState" in line for line in log.read_bytes().splitlines()]
    first_status = is_status.index(True)
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[first_status:]))
    kept = fleet_of(Site(), Measures())
    for name in crossing(60.0, 1.7):
        kept.receive(identity(name, NOW_S - 600), NOW_S - 600, Connection(1, "127.0.0.1", vendor="Alder"))
    KeptMessages(tmp_path, kept, Measures()).write(-inf, NOW_S)
    box = write_blackbox(floor.order())
    assert box
    messages = [json.loads(line).get("message", {}) for line in lines(floor, box)]
    identified = {message["uuid"] for message in messages if "baseRobotEnvelope" in message}
    assert identified == {robot(name) for name in crossing(60.0, 1.7)}


def test_a_log_that_began_with_the_clock_far_ahead_hides_no_near_miss(tmp_path: Path) -> None:
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "log-01947000000000000.jsonl").write_text('{"tick":"2031-09-13T00:00:00Z"}\n')
    assert write_blackbox(lived(tmp_path, crossing(60.0, 1.7), 80).order())


def test_a_box_is_a_log_that_others_can_read(floor: Floor, box: Box) -> None:
    packed = file_of(floor, box).read_bytes()
    data = zstandard.ZstdDecompressor().decompressobj().decompress(packed)
    assert all(json.loads(line) for line in data.splitlines())
