import pytest

from ingest.security.origin_check import is_fixed, is_page_elsewhere


@pytest.mark.parametrize(
    ("origin", "host", "elsewhere"),
    [
        ("http://localhost", "10.0.0.5:3000", False),
        ("http://localhost:5173", "localhost:3000", False),
        ("http://sim.localhost", "127.0.0.1:3000", False),
        ("http://[::1]:8080", "[::1]:3000", False),
        ("http://10.0.0.5:8080", "10.0.0.5:3000", False),
        ("http://203.0.113.9", "127.0.0.1:3000", True),
        ("http://elsewhere.example", "127.0.0.1:3000", True),
        ("http://elsewhere.example:3000", "elsewhere.example:3000", True),
        ("http://localhost.elsewhere.example", "localhost.elsewhere.example", True),
        ("http://127.0.0.1.elsewhere.example", "127.0.0.1", True),
        ("http://localhost@elsewhere.example", "localhost", True),
        ("null", "127.0.0.1:3000", True),
        ("", "127.0.0.1:3000", True),
        ("http://[::1", "[::1", True),
        ("file://", "", True),
    ],
)
def test_a_page_is_of_this_machine_or_of_the_address_asked_or_elsewhere(
    origin: str, host: str, elsewhere: bool
) -> None:
    assert is_page_elsewhere(origin, host) is elsewhere


@pytest.mark.parametrize("host", ["2130706433", "0x7f.1", "127.1", "localhost.", "elsewhere.example", ""])
def test_a_name_that_only_looks_like_an_address_is_not_fixed(host: str) -> None:
    assert not is_fixed(host)
