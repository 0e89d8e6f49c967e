"""Commands in the process of the test: to start a process takes a second, and some seconds with the engine."""

from pathlib import Path

from deconflict.__main__ import parser


def run(*words: str | Path) -> None:
    """Run a command that succeeds. Errors are raised, which as a process it writes in one line."""
    args = parser().parse_args([str(keyword) for keyword in words])
    assert args.run(args) == 0
