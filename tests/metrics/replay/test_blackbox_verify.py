import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zstandard

from deconflict.__main__ import parser
from deconflict.operator.blackbox.archive import REGISTER, Archive
from deconflict.operator.blackbox.blackbox_writer import write_blackbox
from deconflict.operator.blackbox.hash_chain import HashChain
from deconflict.operator.blackbox.start_state import BoxError, head_of
from ingest.recording.log_reader import lines_of
from metrics.replay.blackbox_verify import verify
from tests.deconflict.operator.blackbox.made_floor import Floor, crossing, lived
from tests.helpers.commands import run


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Floor:
    """Two that pass each other at a hand's breadth, after others have taught the engine something."""
    return lived(tmp_path_factory.mktemp("floor"), crossing(150.0, 1.7), 180, sways_s=90.0)


@pytest.fixture(scope="module")
def file(floor: Floor) -> Path:
    made = write_blackbox(floor.order())
    assert made
    return Path(floor.order().archive / made["file"])


def test_the_replay_of_a_black_box_gives_the_published_advisories(file: Path) -> None:
    verdict = verify(file)
    assert (verdict.same, verdict.published > 2, verdict.restarts) == (True, True, 0), verdict.text()


def test_without_the_learned_state_the_replay_differs(file: Path, tmp_path: Path) -> None:
    forged = rewritten(file, tmp_path / "forged.jsonl", lambda head: head | {"learned": None})
    assert not verify(forged).same


def test_changed_decisions_are_detected_by_the_replay(file: Path, tmp_path: Path) -> None:
    """Also where the chain was made anew, which the hash that the service logged would show."""
    forged, chain = tmp_path / "forged.jsonl", HashChain()
    with forged.open("wb") as out:
        for line in list(lines_of(file))[:-1]:
            document = json.loads(line)
            if "advisory" in document and document["advisory"]["state"] == "raised":
                continue
            out.write(chain.link(unlinked(line)))
        out.write(chain.end())
    verdict = verify(forged)
    assert verdict.sha256 != verify(file).sha256
    assert [answer["event"] for answer in verdict.added] == ["raised"]


def test_the_commands_verify_list_and_replay(
    floor: Floor, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("blackbox", "verify", file)
    assert "the replay gives the same" in capsys.readouterr().out
    run("blackbox", "list", "--data", floor.data)
    listed = capsys.readouterr().out
    assert str(file) in listed
    assert "for Alder B-1 would have avoided it" in listed
    advisories = tmp_path / "advisories.jsonl"
    run("replay", file, "--advisories", advisories, "--json", tmp_path / "out.json")
    document = [json.loads(line)["id"] for line in advisories.read_text().splitlines()]
    assert {advisory.id for advisory in floor.decided} == set(document)


def test_a_changed_file_is_reported_with_the_place_of_the_change(file: Path, tmp_path: Path) -> None:
    changed = tmp_path / "changed.jsonl"
    changed.write_bytes(b"".join(lines_of(file)).replace(b'"navigating"', b'"idle"', 1))
    with pytest.raises(BoxError, match=r"was changed or cut off: line \d+ does not carry the hash"):
        verify(changed)


def test_a_truncated_and_resealed_box_is_detected_by_the_register(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its own chain holds: so it does for whoever leaves the last lines out."""
    before, chain = file.read_bytes(), HashChain()
    try:
        with zstandard.open(file, "wb") as out:
            for line in list(lines_of_bytes(before))[:-50]:
                out.write(chain.link(unlinked(line)))
            out.write(chain.end())
        with pytest.raises(BoxError, match="was rewritten"):
            verify(file)
        args = parser().parse_args(["blackbox", "verify", str(file)])
        assert args.run(args) == 1
        assert "was rewritten" in capsys.readouterr().err
    finally:
        file.write_bytes(before)
    assert verify(file).same


def test_a_removed_box_is_detected_by_the_next_one(floor: Floor, tmp_path: Path) -> None:
    Archive(tmp_path).add(
        {
            "file": "blackbox-20000101T000000000Z.jsonl.zst",
            "bytes": 1,
            "sha256": "ab" * 32,
            "until": "2000-01-01T00:00:00Z",
            "near_misses": [],
        }
    )
    made = write_blackbox(replace(floor.order(), archive=tmp_path))
    assert made
    assert verify(tmp_path / made["file"]).same
    register = tmp_path / REGISTER
    register.write_text(register.read_text().replace("ab" * 32, "cd" * 32))
    with pytest.raises(BoxError, match="does not follow the file before it"):
        verify(tmp_path / made["file"])


def lines_of_bytes(packed: bytes) -> list[bytes]:
    return zstandard.ZstdDecompressor().stream_reader(packed).read().splitlines(keepends=True)


@pytest.mark.parametrize("content", [b"", b"{}\n", b"\x28\xb5\x2f\xfdnothing", b'{"blackbox":{"format":9}}\n'])
def test_a_file_that_is_not_a_black_box_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "box.jsonl.zst"
    file.write_bytes(content if content[:1] != b"{" else zstandard.compress(content))
    with pytest.raises(BoxError, match=r"is not a black box|has format 9"):
        verify(file)


def rewritten(file: Path, to: Path, change: Callable[[dict[str, Any]], dict[str, Any]]) -> Path:
    head, chain = head_of(file), HashChain()
    assert head
    with to.open("wb") as out:
        out.write(chain.link(json.dumps({"blackbox": change(head)}).encode() + b"\n"))
        for line in list(lines_of(file))[1:-1]:
            out.write(chain.link(unlinked(line)))
        out.write(chain.end())
    return to


def unlinked(line: bytes) -> bytes:
    return b"{" + line[len(b'{"before":"') + 64 + len(b'",') :]


def test_a_directory_in_which_no_service_has_run_has_no_list(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(BoxError, match="expected the data directory of a service that has run"):
        run("blackbox", "list", "--data", tmp_path)
    (tmp_path / "advisories.db").touch()
    run("blackbox", "list", "--data", tmp_path)
    assert capsys.readouterr().err == f"no near misses in {tmp_path}\n"
