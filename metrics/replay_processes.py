"""Where a replay runs: in one process, in several, or on a Dask cluster. The results are the same."""

import argparse
import os
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

from metrics.replay_files import LogError

Replay = Callable[..., dict[str, Any]]
"""As `metrics.replay.replay.replay`."""


def add_processes(command: argparse.ArgumentParser) -> None:
    """Add the options that say where a replay runs."""
    command.add_argument(
        "--jobs",
        type=_jobs,
        default=len(os.sched_getaffinity(0)),
        metavar="N",
        help="1: all in one process; more: reading, each engine and scoring in processes of their own "
        "(default: the cores that this command may use)",
    )
    command.add_argument(
        "--scheduler",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="run on a Dask cluster; without an address, on the cores of this machine",
    )


def chosen_replay(args: argparse.Namespace, files: ExitStack) -> Replay:
    """The replay that the options ask for; in one process with `--probabilities`, which the others do not publish.
    Closing `files` ends what it needs. Its errors are `LogError`."""
    if args.scheduler is not None and not args.probabilities:
        return _on_cluster(args.scheduler, files)
    if args.jobs > 1 and not args.probabilities:
        return _in_processes
    from metrics.replay.replay import replay  # noqa: PLC0415 - brings kernels

    return replay


def _in_processes(*arguments: Any, **options: Any) -> dict[str, Any]:
    from metrics.replay import parallel_replay  # noqa: PLC0415 - brings kernels

    try:
        return parallel_replay.replay(*arguments, **options)
    except parallel_replay.ReplayProcessError as error:
        raise LogError(str(error)) from error


def _on_cluster(address: str, files: ExitStack) -> Replay:
    """The replay on a Dask cluster. Closing `files` disconnects from it."""
    try:
        from metrics.replay import dask_replay  # noqa: PLC0415 - Dask is optional
    except ImportError as error:
        raise LogError(f"--scheduler needs Dask ({error}): pip install '.[dask]'") from error
    try:
        return partial(dask_replay.replay, files.enter_context(dask_replay.cluster(address)))
    except dask_replay.ClusterError as error:
        raise LogError(str(error)) from error


def _jobs(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of processes: give 1 or more")
    return int(text)
