"""Parcels of revisions, as the engine cuts them and the operator face reads them."""

from deconflict.runtime.parcels import MOST_BYTES, MOST_LINES, cut_into_parcels, packed_parcel, unpacked_parcel


def test_a_parcel_has_at_most_so_many_lines_and_keeps_their_order() -> None:
    lines = [b"%d" % number for number in range(2 * MOST_LINES + 1)]
    parcels = cut_into_parcels(lines)
    assert [len(parcel) for parcel in parcels] == [MOST_LINES, MOST_LINES, 1]
    assert [line for parcel in parcels for line in parcel] == lines


def test_a_parcel_has_at_most_so_many_bytes_unless_it_is_a_single_line() -> None:
    short, long = b"x" * (MOST_BYTES // 3), b"x" * (MOST_BYTES + 1)
    parcels = cut_into_parcels([short, short, short, short, long, short])
    assert parcels == [[short] * 3, [short], [long], [short]]


def test_no_lines_need_no_parcel() -> None:
    assert cut_into_parcels([]) == []


def test_a_parcel_is_read_as_it_was_packed() -> None:
    assert unpacked_parcel(packed_parcel({"measures": [{}]}, [b'{"a": 1}', b"{}"])) == (
        {"measures": [{}]},
        [b'{"a": 1}', b"{}"],
    )
    assert unpacked_parcel(packed_parcel({})) == ({}, [])
