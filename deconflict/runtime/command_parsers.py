"""What all commands share: their parsers with examples, the exit code, and the garbage collector's thresholds."""

import argparse
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, TypeAlias

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
MISUSED = 2
"""Exit code if arguments, the site file, a log or credentials can't be used: the same for every command."""
GC_THRESHOLDS = (50_000, 20, 100)
"""Thresholds of Python's cyclic garbage collector. Reference cycles are rare here. A high threshold avoids scans of
millions of objects."""


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


def positive(text: str) -> int:
    """The type of an argument that counts something."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number of at least 1")
    return int(text)
