from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import Fault, blocked, without_its_disk
from deconflict.operator.store.learned_file import FAILURES, LearnedFile
from ingest.measures.measures import Measures
from ingest.recording.replaced_file import ASIDE


def test_the_newest_file_is_read_and_no_other_is_left(tmp_path: Path) -> None:
    file = LearnedFile(tmp_path, Measures())
    assert file.read() == b""
    for each in (b"old", b"new"):
        file.write(each)
    assert file.read() == b"new"
    assert [path.name for path in tmp_path.iterdir()] == [file.path.name]


def test_an_unreadable_file_is_set_aside_and_counted(tmp_path: Path) -> None:
    measures = Measures()
    file = LearnedFile(tmp_path, measures)
    file.write(b"damaged")
    file.set_aside("it is damaged")
    assert file.read() == b""
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"damaged"]
    assert measures.values[FAILURES] == {("read",): 1, ("write",): 0}


@pytest.mark.parametrize("fault", [blocked, without_its_disk])
def test_a_file_that_is_there_after_the_start_is_set_aside_and_not_replaced(tmp_path: Path, fault: Fault) -> None:
    (data := tmp_path / "data").mkdir()
    LearnedFile(data, Measures()).write(b"before")
    file = LearnedFile(data, Measures())
    with fault(file.path):
        assert file.read() == b""
        file.write(b"lost")
    for each in (b"first", b"second"):
        file.write(each)
    assert file.read() == b"second"
    assert (data / f"{file.path.name}{ASIDE}").read_bytes() == b"before"


def test_a_failed_write_is_counted_and_leaves_the_old_file(tmp_path: Path) -> None:
    measures = Measures()
    file = LearnedFile(tmp_path, measures)
    file.write(b"old")
    (tmp_path / "learned.new").mkdir()
    file.write(b"new")
    assert (file.read(), measures.values[FAILURES][("write",)]) == (b"old", 1)
