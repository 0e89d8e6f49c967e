import pytest

from ingest.languages.visible_text import visible, visible_lines
from ingest.port.connection import Connection
from tests.helpers.saying import identity
from tests.ingest.fleet.made_fleet import NOW_S, document, fleet


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("A-7 \x1b[2Jgone", "A-7 \\x1b[2Jgone"),
        ("a\r\nb\tc\x7f\x9b", "a\\r\\nb\\tc\\x7f\\x9b"),
        ("\u202eevil\u2066", "\\u202eevil\\u2066"),
        ("a\u2028b\u2029c\u200b", "a\\u2028b\\u2029c\\u200b"),
        ("\ud800", "\\ud800"),
        ("\U000e0041", "\\U000e0041"),
        ("Łódź 机器人 \u0645\u06cc\u200c\u062e 5\u00a0m", "Łódź 机器人 \u0645\u06cc\u200c\u062e 5\u00a0m"),
        ("", ""),
    ],
)
def test_what_controls_a_terminal_is_written_out(text: str, shown: str) -> None:
    assert visible(text) == shown


def test_lines_stay_lines() -> None:
    assert visible_lines("a\x1b\nb") == "a\\x1b\nb"


def test_names_of_robots_and_vendors_are_visible_text() -> None:
    receiving_fleet = fleet()
    message = identity("A-1", NOW_S, manufacturerName="Al\x1b[0mder", robotSerialNumber="7\n8")
    assert receiving_fleet.receive(message, NOW_S, Connection(1)) is None
    robot = document(receiving_fleet, "A-1")
    assert (robot["vendor"], robot["name"]) == ("Al\\x1b[0mder", "Al\\x1b[0mder 7\\n8")
    assert robot["identity"]["manufacturerName"] == "Al\x1b[0mder"
