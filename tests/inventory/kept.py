"""The kept inventory: what users have, one line an item, and what was given up on purpose."""

import tomllib
from collections.abc import Iterable
from pathlib import Path

FOLDER = Path(__file__).parent
INVENTORY = FOLDER / "inventory.txt"
GIVEN_UP = FOLDER / "given_up.toml"
LIVE = "live "
"""What lines of a running service begin with."""


class InventoryError(Exception):
    """A file of the inventory can't be used; the message says what to change."""


def kept(*, live: bool) -> set[str]:
    """The kept lines of a running service, or all others."""
    lines = INVENTORY.read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line.startswith(LIVE) == live}


def given_up(text: str) -> dict[str, str]:
    """By line of the inventory, why it was given up. Raises `InventoryError` if an entry has no reason."""
    entries = tomllib.loads(text).get("given_up", [])
    for entry in entries:
        if set(entry) != {"item", "reason"} or not str(entry["reason"]).strip():
            raise InventoryError(f"{GIVEN_UP.name}: {entry} needs an item, a line of {INVENTORY.name}, and a reason")
    return {entry["item"]: entry["reason"] for entry in entries}


def gone(wanted: Iterable[str], present: Iterable[str]) -> list[str]:
    """What users had and no longer have, sorted. What was given up with a reason is left out."""
    return sorted(set(wanted) - set(present) - set(given_up(GIVEN_UP.read_text(encoding="utf-8"))))
