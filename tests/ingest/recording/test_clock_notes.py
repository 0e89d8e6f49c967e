"""A clock alone makes nothing old."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.recording.clock_notes import (
    DAY_S,
    FILE_NAME,
    HOUR_S,
    HOURS,
    ClockFile,
    ClockNotes,
    clock_sentence,
    old_ones,
)
from tests.helpers.made_clock import put_notes

NOW_S = 1_790_000_000.0
MONTH_S = 30 * DAY_S
ASIDE = f"{FILE_NAME}.unreadable"


def ran(notes: ClockNotes, from_s: float, hours: float, every_s: float = 60.0) -> ClockNotes:
    """A service starts with the clock at `from_s`, and runs."""
    notes = notes.noted(from_s, 0.0)
    for step in range(1, round(hours * HOUR_S / every_s) + 1):
        notes = notes.noted(from_s + step * every_s, every_s)
    return notes


RIGHT = ran(ClockNotes(), NOW_S - DAY_S, 24.0)
"""A day of running that ends now."""


def test_a_clock_that_is_right_is_known_after_a_day_of_running() -> None:
    assert ran(ClockNotes(), NOW_S - 0.99 * DAY_S, 23.76).known_time(NOW_S) == (0.0, NOW_S)
    assert RIGHT.known_time(NOW_S) == (NOW_S, NOW_S)
    assert RIGHT.known_time(NOW_S).before_s(2.0) == NOW_S - 2 * DAY_S


@pytest.mark.parametrize("hours", [0.0, 0.5, 1.0, 5.0, 22.9])
def test_a_start_a_month_ahead_adds_the_hours_of_running_to_an_age_and_no_more(hours: float) -> None:
    ahead_s = NOW_S + MONTH_S
    notes = ran(RIGHT, ahead_s, hours)
    assert notes.known_time(ahead_s + hours * HOUR_S).sure_s == pytest.approx(NOW_S + hours * HOUR_S)
    back_s = NOW_S + hours * HOUR_S
    assert notes.noted(back_s, 0.0).known_time(back_s).sure_s == back_s, "corrected, it is right at once"


def test_a_clock_is_believed_once_the_service_has_run_for_a_day_with_it() -> None:
    ahead_s = NOW_S + MONTH_S
    notes = ran(RIGHT, ahead_s, 24.0)
    assert notes.known_time(ahead_s + DAY_S).sure_s == ahead_s + DAY_S
    assert clock_sentence(notes, ahead_s + DAY_S) == ""


def test_hours_of_running_add_up_over_restarts_and_one_note_adds_one_hour_at_most() -> None:
    notes = ClockNotes()
    for start in range(24 * 6):
        notes = ran(notes, NOW_S + start * HOUR_S, 10 / 60)
    assert notes.known_time(NOW_S + 144 * HOUR_S).sure_s > NOW_S + 20 * HOUR_S
    assert len(ran(RIGHT, NOW_S, 0.0).noted(NOW_S + MONTH_S, DAY_S).hours_s) == HOURS
    assert RIGHT.noted(NOW_S + MONTH_S, DAY_S).known_time(NOW_S + MONTH_S).sure_s < NOW_S + 2 * HOUR_S


def test_a_clock_that_jumps_ahead_and_back_again_and_again_is_never_believed() -> None:
    notes, now_s = RIGHT, NOW_S
    for spell in range(20):
        now_s += 5 * HOUR_S
        off_s = MONTH_S if spell % 2 else 0.0
        notes = ran(notes, now_s - 5 * HOUR_S + off_s, 5.0)
        assert notes.known_time(now_s + off_s).sure_s <= now_s + 1e-3


def test_a_clock_at_1970_makes_nothing_old_and_is_over_a_day_of_running_after_it_is_right() -> None:
    notes = ran(RIGHT, 60.0, 2.0)
    assert notes.known_time(60.0).before_s(30.0) == 0.0
    notes = ran(notes, NOW_S + 2 * HOUR_S, 23.9)
    assert notes.known_time(NOW_S + 26 * HOUR_S).before_s(30.0) == 0.0
    assert ran(notes, NOW_S + 26 * HOUR_S, 1.1).known_time(NOW_S + 27 * HOUR_S).sure_s > NOW_S + DAY_S


@pytest.mark.parametrize("off_s", [MONTH_S, -MONTH_S, 3.1 * DAY_S])
def test_people_are_asked_to_look_at_a_clock_that_leapt_until_it_is_back_or_a_day_is_over(off_s: float) -> None:
    notes = ran(RIGHT, NOW_S + off_s, 5.0)
    sentence = clock_sentence(notes, NOW_S + MONTH_S + 5 * HOUR_S)
    assert "clock says 2026-10-21 19:13 UTC, and the newest data before was of 2026-09-21 14:13 UTC: look" in sentence
    assert clock_sentence(notes.noted(NOW_S + 6 * HOUR_S, 60.0), NOW_S) == ""
    assert clock_sentence(ran(notes, NOW_S + off_s + 5 * HOUR_S, 18.9), NOW_S)
    assert clock_sentence(ran(notes, NOW_S + off_s + 5 * HOUR_S, 19.0), NOW_S) == ""


def test_nights_and_weekends_are_no_leap() -> None:
    notes = RIGHT
    for day in (1, 2, 3, 4, 7, 8, 9):
        notes = ran(notes, NOW_S + day * DAY_S, 8.0)
        assert clock_sentence(notes, NOW_S) == ""
    assert notes.known_time(NOW_S + 9 * DAY_S + 8 * HOUR_S).sure_s == NOW_S + 8 * DAY_S, "three days of eight hours ago"


@pytest.mark.parametrize(
    ("times", "old"),
    [("", 0), ("123", 2), ("456", 0), ("193", 3), ("194", 1), ("19", 1), ("1541", 1), ("91", 2), ("9", 0)],
)
def test_what_is_written_after_what_is_not_old_is_not_old(times: str, old: int) -> None:
    """Before 4 is old, and after 7 there is no time."""
    expected = {"123": 3}.get(times, old)
    assert old_ones(times, "4", "7") == expected


class Spell(NamedTuple):
    """A service is off, and runs with a clock that is wrong by some days; then it runs with the right one."""

    off_hours: int
    wrong_by_days: float
    half_hours: int
    right_half_hours: int


SPELLS = st.builds(
    Spell,
    st.sampled_from([0, 0, 0, 1, 14, 64, 400]),
    st.sampled_from([0.0, 0.1, 2.0, 2.9, 6.0, 30.0, 4000.0, -0.1, -2.0, -6.0, -30.0, -4000.0]),
    st.integers(0, 20),
    st.integers(4, 60),
)
KEEP_DAYS = 5.0


class Written(NamedTuple):
    true_s: float
    stamp_s: float
    anchor_s: float
    """When something was written last whose time was not behind."""


def lived(spells: list[Spell]) -> Iterator[tuple[float, list[Written]]]:
    """What is removed at a time. Something is written, and removed, each half an hour of running."""
    notes, true_s, anchor_s = RIGHT, NOW_S, NOW_S
    kept = [Written(NOW_S, NOW_S, NOW_S)]
    for spell in spells:
        true_s += spell.off_hours * HOUR_S
        for off_days, half_hours in ((spell.wrong_by_days, spell.half_hours), (0.0, spell.right_half_hours)):
            for _ in range(half_hours):
                true_s += HOUR_S / 2
                clock_s = true_s + off_days * DAY_S
                anchor_s = true_s if off_days >= 0.0 else anchor_s
                kept.append(Written(true_s, clock_s, anchor_s))
                notes = notes.noted(clock_s, HOUR_S / 2)
                known = notes.known_time(clock_s)
                old = old_ones([each.stamp_s for each in kept], known.before_s(KEEP_DAYS), known.latest_s)
                yield true_s, kept[:old]
                del kept[:old]


@given(st.lists(SPELLS, max_size=25))
def test_nothing_young_is_removed_whatever_the_clock_does_for_less_than_a_day(spells: list[Spell]) -> None:
    """What was written with a clock that was behind may go with what was written last before it."""
    for true_s, removed in lived(spells):
        assert all(true_s - each.anchor_s >= KEEP_DAYS * DAY_S - 1.0 for each in removed)


def test_what_is_old_is_removed_after_a_month_off_and_a_wrong_clock() -> None:
    spells = [Spell(0, 0.0, 0, 60), Spell(0, 4000.0, 10, 60), Spell(720, 0.0, 0, 49)]
    removed = [len(removed) for _, removed in lived(spells)]
    assert removed == [0] * (60 + 10 + 60 + 47) + [1 + 60 + 10 + 60] + [0]


def test_the_file_is_kept_from_the_first_note_to_the_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ingest.recording.clock_notes.NOTE_EVERY_S", 0.0)
    put_notes(tmp_path, NOW_S)
    stop, steady_s = Event(), iter(range(0, 100_000, 60))

    def wall() -> float:
        if (read := next(steady_s)) > 3_600:
            stop.set()
        return NOW_S + read

    ClockFile(tmp_path, wall).keep(stop, lambda: float(next(steady_s)))
    notes = ClockFile(tmp_path, lambda: NOW_S + DAY_S).read()
    assert (len(notes.hours_s), notes.hours_s[-1] > NOW_S + HOUR_S / 2) == (HOURS, True)
    assert notes.before_leap_s is None
    assert NOW_S < ClockFile(tmp_path, lambda: NOW_S + DAY_S).known_time().sure_s <= NOW_S + 2 * HOUR_S


def test_data_of_a_clock_that_was_behind_at_the_start_is_not_old_once_the_clock_is_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The service's own time goes on, so all that it writes until its next start is of a month ago."""
    monkeypatch.setattr("ingest.recording.clock_notes.NOTE_EVERY_S", 0.0)
    stop, ran_s = Event(), 0.0

    def steady() -> float:
        nonlocal ran_s
        ran_s += 10 * 60
        if ran_s > 4 * DAY_S:
            stop.set()
        return ran_s

    ClockFile(tmp_path, lambda: NOW_S + ran_s - (MONTH_S if ran_s < DAY_S else 0.0)).keep(stop, steady)
    known = ClockFile(tmp_path, lambda: NOW_S + ran_s).known_time()
    assert 0.0 < known.sure_s < NOW_S + 5 * DAY_S - MONTH_S


def started(data: Path, clock_s: float) -> ClockNotes:
    stop = Event()
    stop.set()
    ClockFile(data, lambda: clock_s).keep(stop)
    return ClockFile(data, lambda: clock_s).read()


def test_without_the_file_the_newest_file_of_the_directory_says_when_the_service_ran(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert started(tmp_path / "new", NOW_S) == ClockNotes()
    (tmp_path / "advisories.db").touch()
    os.utime(tmp_path / "advisories.db", (NOW_S, NOW_S))
    assert started(tmp_path, NOW_S + MONTH_S).before_leap_s == NOW_S
    assert "look at the clock" in caplog.text


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"hours_s":[1e300]}', b'{"since_s":-1}', b"[" * 100_000])
def test_a_file_that_is_no_notes_is_set_aside_and_makes_nothing_old(tmp_path: Path, content: bytes) -> None:
    (tmp_path / FILE_NAME).write_bytes(content)
    assert ClockFile(tmp_path, lambda: NOW_S).known_time() == (0.0, NOW_S)
    assert started(tmp_path, NOW_S).last_s == NOW_S
    assert (tmp_path / ASIDE).read_bytes() == content


def test_a_pipe_in_place_of_the_file_is_told_once_and_stops_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ingest.recording.clock_notes.NOTE_EVERY_S", 0.0)
    caplog.set_level(logging.WARNING)
    os.mkfifo(tmp_path / FILE_NAME)
    stop, clock_s = Event(), iter(range(60))

    def wall() -> float:
        if (read := next(clock_s)) == 20:
            stop.set()
        return NOW_S + read

    ClockFile(tmp_path, wall).keep(stop)
    assert ClockFile(tmp_path).read() == ClockNotes()
    assert len([record for record in caplog.records if "written" in record.getMessage()]) == 1
