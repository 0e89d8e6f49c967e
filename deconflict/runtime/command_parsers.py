"""What all commands share: their parsers with examples, the exit code, and the garbage collector's thresholds."""

import argparse
from collections.abc import Callable, Sequence
from contextlib import suppress
from difflib import get_close_matches
from typing import Any, TypeAlias, TypeVar

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
LONGEST_S = 366 * 86_400
"""The longest time that a command is told to run for."""
MOST_JOBS = 1000
MOST_SHOWN = 40
"""Characters of a wrong argument that are repeated."""
MISUSED = 2
"""Exit code if arguments, the site file, a log or credentials can't be used: the same for every command."""
GC_THRESHOLDS = (50_000, 20, 100)
"""Thresholds of Python's cyclic garbage collector. Reference cycles are rare here. A high threshold avoids scans of
millions of objects."""

_Number = TypeVar("_Number", int, float)


class CommandParser(argparse.ArgumentParser):
    """A parser that names the option, or the command or other choice, that was probably meant."""

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[argparse.Namespace, list[str]]:
        parsed, left = super().parse_known_args(args, namespace)
        for argument in left:
            wanted = argument.partition("=")[0]
            if wanted.startswith("--") and (near := get_close_matches(wanted, self._option_string_actions, 1)):
                self.error(f"there is no option {wanted}; did you mean {near[0]}?")
        return parsed, left

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        near = get_close_matches(str(value), map(str, action.choices or ()), 1)
        if near and value not in (action.choices or ()):
            raise argparse.ArgumentError(action, f"there is no {value!r}; did you mean {near[0]}?")
        super()._check_value(action, value)


def add_command(commands: Commands, name: str, purpose: str, *examples: str) -> argparse.ArgumentParser:
    """A parser for a command. `examples` are full command lines, each as a person would type it."""
    lines = "\n".join(f"  {example}" for example in examples)
    return commands.add_parser(
        name,
        help=purpose,
        description=purpose[0].upper() + purpose[1:] + ".",
        epilog=f"examples:\n{lines}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def number_in(least: float, most: float) -> Callable[[str], float]:
    """The type of an argument that is a number in a range."""
    return _within(float, "number", least, most)


def whole_in(least: int, most: int) -> Callable[[str], int]:
    """The type of an argument that is a whole number in a range."""
    return _within(int, "whole number", least, most)


def _within(read: Callable[[str], _Number], noun: str, least: _Number, most: _Number) -> Callable[[str], _Number]:
    def argument(text: str) -> _Number:
        with suppress(ValueError):
            if least <= (found := read(text)) <= most:
                return found
        raise argparse.ArgumentTypeError(f"{text[:MOST_SHOWN]!r} is not in range: give a {noun} from {least} to {most}")

    return argument
