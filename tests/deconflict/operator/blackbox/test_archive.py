from pathlib import Path

import pytest

from deconflict.operator.blackbox.archive import REGISTER, Archive
from deconflict.operator.blackbox.hash_chain import FIRST_HASH
from tests.deconflict.operator.blackbox.made_floor import put


@pytest.fixture
def shelf(tmp_path: Path) -> Archive:
    return Archive(tmp_path)


@pytest.mark.parametrize(
    "bounds",
    [
        {"files": 2, "total_bytes": 10_000, "before": ""},
        {"files": 9, "total_bytes": 250, "before": ""},
        {"files": 9, "total_bytes": 10_000, "before": "2026-09-23"},
    ],
)
def test_number_size_and_age_are_bounded_and_the_oldest_go(shelf: Archive, bounds: dict[str, int | str]) -> None:
    boxes = [put(shelf, number) for number in range(1, 5)]
    gone = shelf.prune(**bounds, latest="2027")  # type: ignore[arg-type]
    assert sorted(gone) == [box["file"] for box in boxes[:2]]
    assert shelf.boxes() == boxes[2:]
    assert [shelf.path(box["file"]) is None for box in boxes] == [True, True, False, False]


@pytest.mark.parametrize(
    ("years", "before", "left"),
    [
        ((2026, 2027, 2026, 2026), "2026-09-24", "4"),
        ((2026, 2027, 2026, 2026), "2026-09-23", "234"),
        ((2026, 2026, 2020, 2026), "2026-09-22", "234"),
        ((2020, 2026, 2020, 2026), "2026-09-22", "234"),
        ((2026, 2026, 2026, 2027), "2026-09-29", "4"),
    ],
)
def test_boxes_are_old_in_the_order_of_writing_whatever_the_clock_said(
    shelf: Archive, years: tuple[int, ...], before: str, left: str
) -> None:
    """2027 is still to come. What was written after a young box is not old."""
    for number, year in enumerate(years, 1):
        put(shelf, number, year=year)
    shelf.prune(files=9, total_bytes=10_000, before=before, latest="2026-12")
    assert numbers(shelf) == left


def numbers(shelf: Archive) -> str:
    return "".join(box["sha256"][0] for box in shelf.boxes())


@pytest.mark.parametrize(
    ("pairs", "sizes", "bounds", "left"),
    [
        ("AB CC CC CC CC", "11111", {"files": 3, "total_bytes": 1000}, "145"),
        ("AB CC BA CC CC", "11111", {"files": 4, "total_bytes": 1000}, "1345"),
        ("AB CC BA CC CC", "11111", {"files": 2, "total_bytes": 1000}, "35"),
        ("AB CC CC AB CC", "91111", {"files": 9, "total_bytes": 5}, "2345"),
        ("CC AB CC CC CC", "11111", {"files": 1, "total_bytes": 1000}, "5"),
        ("AB,CC CC CC CC CC", "11111", {"files": 2, "total_bytes": 1000}, "15"),
    ],
)
def test_vendors_with_many_near_misses_push_out_no_boxes_of_others(
    shelf: Archive, pairs: str, sizes: str, bounds: dict[str, int], left: str
) -> None:
    for number, (each, size) in enumerate(zip(pairs.split(), sizes, strict=True), 1):
        put(shelf, number, int(size), 2026, *each.split(","))
    shelf.prune(**bounds, before="", latest="2027")
    assert numbers(shelf) == left


def test_a_box_is_still_verified_by_the_hash_of_a_removed_neighbour(shelf: Archive) -> None:
    boxes = [put(shelf, number, 1, 2026, pair) for number, pair in enumerate(("AB", "CC", "CC", "CC", "CC"), 1)]
    shelf.prune(files=3, total_bytes=1000, before="", latest="2027")
    assert numbers(shelf) == "145"
    assert shelf.link(boxes[3]["file"]) == (boxes[2]["sha256"], boxes[3]["sha256"])
    shelf.prune(files=2, total_bytes=1000, before="", latest="2027")
    assert shelf.link(boxes[4]["file"]) == (boxes[3]["sha256"], boxes[4]["sha256"])
    assert len((shelf.directory / REGISTER).read_text().splitlines()) <= 4


def test_the_chain_continues_after_every_file_was_removed(shelf: Archive) -> None:
    assert shelf.head() == FIRST_HASH
    last = [put(shelf, number) for number in (1, 2)][-1]
    shelf.prune(files=1, total_bytes=1, before="", latest="2027")
    assert (shelf.boxes(), shelf.head()) == ([], last["sha256"])


@pytest.mark.parametrize(
    "file", ["../advisories.db", REGISTER, "blackbox-20260921T141500000Z.jsonl.zst/../register.jsonl"]
)
def test_no_other_file_of_the_directory_is_served(shelf: Archive, file: str) -> None:
    put(shelf, 1)
    assert shelf.path(file) is None


def test_an_unreadable_line_of_the_register_hides_no_other(shelf: Archive, caplog: pytest.LogCaptureFixture) -> None:
    box = put(shelf, 1)
    with (shelf.directory / REGISTER).open("a") as register:
        register.write('{"file": 3}\nnonsense\n')
    assert shelf.boxes() == [box]
    assert caplog.text.count("is left out") == 2
