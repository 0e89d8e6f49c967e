"""Text that came from outside, as a terminal, a log or a line of a file may show it."""

from unicodedata import category

JOINERS = "\u200c\u200d"
"""Invisible, but some scripts need them."""
UNSHOWN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories of characters that control terminals, end lines, turn the direction of text, or show nothing."""


def visible(text: str) -> str:
    r"""The text on one line, with characters that are not shown written out, as `\x1b`."""
    return text if text.isprintable() else "".join(map(_shown, text))


def visible_lines(text: str) -> str:
    """The same, line by line."""
    return "\n".join(map(visible, text.split("\n")))


def _shown(character: str) -> str:
    is_shown = character in JOINERS or category(character) not in UNSHOWN
    return character if is_shown else character.encode("unicode_escape").decode()
