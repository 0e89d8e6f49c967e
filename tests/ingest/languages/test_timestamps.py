from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ingest.languages.timestamps import parse, plain_seconds, plausible, write

moments = st.datetimes(datetime(1971, 1, 1), datetime(2099, 12, 31), timezones=st.just(UTC))  # noqa: DTZ001


@given(moments)
def test_what_is_written_reads_back(moment: datetime) -> None:
    text = write(moment.timestamp())
    stamp = parse(text)
    assert stamp is not None
    assert (stamp.t_s, stamp.resolution_s, stamp.findings) == (moment.timestamp(), 1e-6, ())


@given(moments, st.integers(-14 * 60, 14 * 60))
def test_any_offset_names_the_same_moment(moment: datetime, offset_min: int) -> None:
    stamp = parse(moment.astimezone(timezone(timedelta(minutes=offset_min))).isoformat())
    assert stamp is not None
    assert stamp.t_s == pytest.approx(moment.timestamp(), abs=1e-6)
    assert stamp.findings == (("stamp-not-utc",) if offset_min else ())


fractions = st.tuples(st.sampled_from(".,"), st.text("0123456789", min_size=1)) | st.just(("", ""))


@given(moments, st.sampled_from("Tt "), fractions, st.sampled_from(("Z", "z", " Z")))
def test_a_date_time_is_the_same_however_it_is_spelt(
    moment: datetime, letter: str, fraction: tuple[str, str], zulu: str
) -> None:
    point, digits = fraction
    stamp = parse(f"{moment:%Y-%m-%d}{letter}{moment:%H:%M:%S}{point}{digits}{zulu}")
    assert stamp is not None
    assert stamp.t_s == moment.replace(microsecond=int(f"{digits[:6]:0<6}")).timestamp()
    assert stamp.findings == (() if letter + point + zulu in {"TZ", "T.Z"} else ("stamp-spelling",))
    assert stamp.resolution_s == pytest.approx(10.0 ** -min(len(digits), 9))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "Z",
        "soon",
        "2023-11-14",
        "2023-11-14T22:13Z",
        "2023-W46-2T22:13:20Z",
        "2023-11-14T22:13:20.Z",
        "2023-11-14T22:13:20.123456xZ",
        "2023-11-14T22:13:20.12345678\u0663Z",
        "2023-11-14T22:13:61Z",
        "2023-11-14T24:00:00Z",
        "2023-02-29T00:00:00Z",
        "2023-11-14T22:13:20+99:00",
        "2023-11-14T22:13:20\t+00:00",
        "-1700000000",
        "1.7e9",
        "\u0661\u0667" + "\u0660" * 8,
        "1" * 21,
    ],
)
def test_a_text_that_is_no_time_gives_none(text: str) -> None:
    assert parse(text) is None


def test_a_leap_second_is_the_one_after() -> None:
    leap, after = parse("2016-12-31T23:59:60Z"), parse("2017-01-01T00:00:00Z")
    assert leap == after


@pytest.mark.parametrize(
    ("text", "t_s", "resolution_s"),
    [
        ("1627000000", 1627000000.0, 1.0),
        ("1627000000123", 1627000000.123, 1e-3),
        ("1627000000123456", 1627000000.123456, 1e-6),
        ("1627000000123456789", 1627000000.123456789, 1e-9),
        ("1627000000 5", 1627000000.000000005, 1e-9),
        ("3.25", 3.25, 0.01),
        ("1627000000.25", 1627000000.25, 0.01),
        ("1627000000123.456", 1627000000.123456, 1e-6),
        ("1627000000123456.5", 1627000000.1234565, 1e-7),
    ],
)
def test_a_count_from_1970_is_read_by_its_size(text: str, t_s: float, resolution_s: float) -> None:
    stamp = parse(text)
    assert stamp is not None
    assert (stamp.t_s, stamp.resolution_s) == pytest.approx((t_s, resolution_s), rel=1e-12)
    assert stamp.findings == ("stamp-epoch",)


def test_digits_beyond_a_nanosecond_add_no_resolution() -> None:
    stamp = parse("2023-11-14T22:13:20." + "1" * 5000 + "Z")
    assert stamp is not None
    assert stamp.resolution_s == 1e-9


spellings = st.builds(
    lambda moment, digits, ending: f"{moment:%Y-%m-%dT%H:%M:%S}{'.' + digits if digits else ''}{ending}",
    st.datetimes(datetime(1950, 1, 1), datetime(2120, 1, 1)),  # noqa: DTZ001
    st.text("0123456789", max_size=25),
    st.sampled_from(("Z", "Z", "Z", "+00:00", "z", "+01:00", "+0000", "")),
)


@given(st.lists(spellings, min_size=1, max_size=4))
@example(["2000-01-01T00:00:00"])
def test_many_plain_stamps_name_what_each_names_and_break_the_rules_that_each_breaks(texts: list[str]) -> None:
    each = [parse(text) for text in texts]
    read = plain_seconds(texts)
    if read is None:
        odd = {"stamp-spelling", "stamp-epoch"}
        rows = zip(each, texts, strict=True)
        assert any(
            not stamp or odd & {*stamp.findings} or not plausible(stamp.t_s) or len(text) > 40 for stamp, text in rows
        )
    else:
        times_s, findings = read
        assert [stamp.t_s for stamp in each if stamp] == times_s
        rules = [rule for stamp in each if stamp for rule in stamp.findings]
        assert list(dict.fromkeys(findings)) == list(dict.fromkeys(rules))
        assert all(map(plausible, times_s))


@given(st.floats(-1e9, 4e9))
def test_a_time_is_written_as_datetime_writes_it(t_s: float) -> None:
    assert write(t_s) == datetime.fromtimestamp(t_s, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
