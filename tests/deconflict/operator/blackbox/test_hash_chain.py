import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deconflict.operator.blackbox.hash_chain import ChainBrokenError, HashChain, verified

LINES = st.lists(
    st.dictionaries(st.text(max_size=5), st.text(max_size=9), min_size=1, max_size=3), min_size=1, max_size=9
)


def chained(documents: list[dict[str, str]]) -> tuple[HashChain, list[bytes]]:
    chain = HashChain()
    lines = [chain.link(json.dumps(document).encode() + b"\n") for document in documents]
    return chain, [*lines, chain.end()]


@given(LINES)
def test_a_chain_proves_itself_and_its_lines_stay_json(documents: list[dict[str, str]]) -> None:
    chain, lines = chained(documents)
    assert verified(lines) == chain
    assert [set(json.loads(line)) - {"before"} for line in lines[:-1]] == [
        set(document) - {"before"} for document in documents
    ]


@given(LINES, st.data())
def test_any_changed_byte_is_found_or_changes_the_last_hash(
    documents: list[dict[str, str]], data: st.DataObject
) -> None:
    chain, lines = chained(documents)
    row = data.draw(st.integers(0, len(lines) - 1))
    at = data.draw(st.integers(0, len(lines[row]) - 1))
    other = data.draw(st.integers(0, 255).filter(lambda byte: byte != lines[row][at]))
    lines[row] = lines[row][:at] + bytes([other]) + lines[row][at + 1 :]
    try:
        head = verified(lines).head
    except ChainBrokenError:
        return
    assert head != chain.head


def test_lines_without_a_chain_are_an_error() -> None:
    for lines in ([], [b"{}\n"], [b"nothing\n"]):
        with pytest.raises(ChainBrokenError):
            verified(lines)


def test_an_end_with_a_wrong_count_is_found_though_its_hashes_fit() -> None:
    chain = HashChain()
    lines = [chain.link(b'{"a":1}\n'), chain.link(b'{"end":2}\n')]
    with pytest.raises(ChainBrokenError, match="the last line counts 2 lines and there are 1"):
        verified(lines)
