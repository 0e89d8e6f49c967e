"""Nothing that users had is gone, unless `given_up.toml` says why."""

import pytest

from tests.inventory.kept import GIVEN_UP, InventoryError, given_up, gone, kept
from tests.inventory.live_service import live_lines
from tests.inventory.offered import offered_lines


def failure(lines: list[str]) -> str:
    return "\n".join(["no longer offered; bring it back, or name it with a reason in given_up.toml:", *lines])


def test_nothing_that_users_had_is_gone() -> None:
    lines = gone(kept(live=False), offered_lines())
    assert not lines, failure(lines)


def test_a_running_service_shows_everything_that_it_did() -> None:
    """Traffic differs, so what one service did not show is looked for in another."""
    lines = gone(kept(live=True), ())
    for _ in range(3):
        lines = lines and gone(lines, live_lines(set(lines)))
    assert not lines, failure(lines)


def test_what_is_given_up_was_offered_and_has_a_reason() -> None:
    entries = given_up(GIVEN_UP.read_text(encoding="utf-8"))
    assert set(entries) <= kept(live=True) | kept(live=False)
    with pytest.raises(InventoryError, match="reason"):
        given_up('[[given_up]]\nitem = "extra plot"\nreason = " "\n')
