"""Black boxes proved: that no line was changed, and that a replay tells what was told."""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zstandard

from deconflict.advisory import ADVISORY, ConflictAdvisory
from deconflict.operator.blackbox.archive import FOLDER, Shelf
from deconflict.operator.blackbox.hash_chain import Chain, ChainBrokenError, verified
from deconflict.operator.blackbox.start_state import BoxError, head_of, site_of, start_of
from ingest.languages.massrobotics import timestamps
from ingest.recording.log_reader import Noted, Reader, lines_of

Line = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of one file."""

    lines: int
    sha256: str
    """Of the last line."""
    told: int
    """Revisions of conflicts in the promised time."""
    missing: list[Line]
    """Of them, those that the replay does not tell."""
    added: list[Line]
    """What only the replay tells."""
    restarts: int
    """Of the engine in that time: after one the two may differ."""

    @property
    def same(self) -> bool:
        return not self.missing and not self.added

    def words(self) -> str:
        """It for a person."""
        told = f"{self.lines} lines, unchanged; the last has sha256 {self.sha256}\n"
        if self.same:
            return f"{told}the replay tells the same {self.told} revisions of conflicts\n"
        why = f" (the engine was restarted {self.restarts} times meanwhile)" if self.restarts else ""
        lines = [*(f"- {one['at']} {one['event']} {one['summary']}" for one in self.missing)]
        lines += [f"+ {one['at']} {one['event']} {one['summary']}" for one in self.added]
        return f"{told}the replay differs{why}:\n" + "\n".join(lines) + "\n"


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    boxes = commands.add_parser("blackbox", help="near misses, each with what was heard and decided around it")
    parts = boxes.add_subparsers(dest="part", required=True)
    listed = parts.add_parser("list", help="what there is, and what would have avoided it")
    listed.add_argument("--data", type=Path, default=Path("data"), help="the service's directory")
    listed.set_defaults(run=_list)
    proved = parts.add_parser("verify", help="prove that a file is unchanged and replays to what was told")
    proved.add_argument("files", nargs="+", type=Path, metavar="FILE")
    proved.set_defaults(run=_verify)


def verify(file: Path) -> Verdict:
    """Prove one file. Raises `BoxError`."""
    from metrics.replay.replay import advisory_line, replay  # noqa: PLC0415 - brings numba

    head = head_of(file)
    if head is None:
        raise BoxError(f"{file} is no black box")
    try:
        chain = verified(lines_of(file))
    except (ChainBrokenError, EOFError, OSError, zstandard.ZstdError) as error:
        raise BoxError(f"{file} was changed or cut off: {error}") from error
    _registered(file, chain)
    site, again, reader, decided = site_of(head), list[Line](), Reader(), list[Line]()
    for event in reader.read([file]):
        if isinstance(event, Noted) and "decided" in event.told:
            one = ADVISORY.validate_python(event.told["advisory"])
            if isinstance(one, ConflictAdvisory):
                decided.append(advisory_line(one))
    replay(reader, reader.read([file]), site, [site.conflict.clearance_m], tell=again.append, start=start_of(head))
    decided, again = _promised(head, decided), _promised(head, again)
    return Verdict(
        chain.lines,
        chain.head,
        len(decided),
        [one for one in decided if one not in again],
        [one for one in again if one not in decided],
        int(head.get("engine_restarts", 0)),
    )


def _registered(file: Path, chain: Chain) -> None:
    """Compare a file with the register beside it, where there is one. Raises `BoxError`."""
    before, last = Shelf(file.parent).link(file.name)
    if last not in (None, chain.head):
        raise BoxError(f"{file} was written anew: its last line has sha256 {chain.head}, the register beside it {last}")
    if before not in (None, chain.first):
        raise BoxError(f"{file} does not follow the one before it in the register: one was taken out or put in")


def _promised(head: Mapping[str, Any], lines: list[Line]) -> list[Line]:
    """Those of the time in which the file promises to tell the same."""
    until = (head["from"], head["until"])
    return [one for one in lines if until[0] <= _stamp(one["at"]) <= until[1]]


def _stamp(text: str) -> str:
    stamp = timestamps.parse(text)
    return timestamps.write(stamp.t_s) if stamp else ""


def _list(args: argparse.Namespace) -> int:
    for box in Shelf(args.data / FOLDER).boxes():
        sys.stdout.write(f"{args.data / FOLDER / box['file']}\n")
        for one in box["near_misses"]:
            sys.stdout.write(f"  {one['at']}  {one['summary']}\n")
    return 0


def _verify(args: argparse.Namespace) -> int:
    failed = 0
    for file in args.files:
        try:
            verdict = verify(file)
        except BoxError as error:
            sys.stderr.write(f"deconflict: {error}\n")
            failed = 1
            continue
        sys.stdout.write(f"{file}: {verdict.words()}")
        failed |= not verdict.same
    return failed
