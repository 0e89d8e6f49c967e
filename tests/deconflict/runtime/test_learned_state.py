import io
import pickle

import numpy as np
import pytest
from numpy.random import default_rng

from deconflict.runtime.learned_state import DAMAGE, Part, UnreadableError, packed, unpacked

PARTS: dict[str, Part] = {
    "ledger": {"counts": default_rng(1).poisson(0.3, (4, 3, 10)).astype(np.float64), "kinds": [["Al.der", "", 1]]},
    "rests": {"marks": []},
}


def values(part: Part) -> Part:
    return {name: np.asarray(value).tolist() for name, value in part.items()}


def test_what_was_packed_is_read_again() -> None:
    read = unpacked(packed(PARTS))
    assert read["ledger"].pop("counts").tolist() == PARTS["ledger"]["counts"].tolist()
    assert read == {"ledger": {"kinds": [["Al.der", "", 1]]}, "rests": {"marks": []}}


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_off_is_unreadable(share: float) -> None:
    whole = packed(PARTS)
    with pytest.raises(UnreadableError):
        unpacked(whole[: int(share * len(whole))])


def test_a_changed_byte_is_found_or_changes_nothing() -> None:
    whole, seen = packed(PARTS), 0
    for at in range(len(whole)):
        try:
            read = unpacked(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
        except UnreadableError:
            seen += 1
        else:
            seen += DAMAGE in read["ledger"]
            for name, part in read.items():
                assert DAMAGE in part or values(part) == values(PARTS[name])
    assert seen > len(whole) / 2


def test_a_foreign_file_is_unreadable() -> None:
    foreign = io.BytesIO()
    np.savez(foreign, a=np.zeros(3))
    for data in (b"hello", foreign.getvalue(), pickle.dumps(PARTS), packed(PARTS).replace(b"head", b"tail")):
        with pytest.raises(UnreadableError):
            unpacked(data)


def test_a_file_of_another_format_says_which(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as newer:
        newer.setattr("deconflict.runtime.learned_state.FORMAT", 99)
        data = packed(PARTS)
    with pytest.raises(UnreadableError, match="format 99"):
        unpacked(data)
