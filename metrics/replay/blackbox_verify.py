"""The `blackbox` command: lists black boxes, and verifies them.

A black box is verified if no line was changed and a replay gives the advisories that the service published.
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deconflict.operator.blackbox.archive import FOLDER, Archive
from deconflict.operator.blackbox.hash_chain import ChainBrokenError, HashChain, verified
from deconflict.operator.blackbox.start_state import BoxError, head_of, site_of, start_of
from deconflict.operator.store.sqlite_connections import FILE_NAME
from deconflict.runtime.command_parsers import Commands, add_command
from deconflict_client.advisory import ADVISORY, AnyAdvisory, ConflictAdvisory
from deconflict_client.counted_nouns import count_of
from ingest.languages import timestamps
from ingest.languages.visible_text import visible, visible_lines
from ingest.recording.compression import DAMAGED
from ingest.recording.log_reader import BlackBoxNote, LogReader, lines_of

Line = dict[str, Any]
RESUMED = (
    "it resumes from a running engine of an earlier release, and the errors of forecasts that were under way then are "
    "not in the box: probabilities can differ, and what follows from them"
)
"""Why the replay of a box of an earlier release may give other decisions."""


@dataclass(frozen=True, slots=True)
class Verification:
    """The result for one file."""

    lines: int
    sha256: str
    """Hash of the last line."""
    published: int
    """Revisions of conflict advisories that the service published in the time for which the file promises to replay."""
    missing: list[Line]
    """Published revisions that the replay does not give."""
    added: list[Line]
    """Revisions that only the replay gives."""
    restarts: int
    """Restarts of the engine in that time. After a restart the two may differ."""
    resumed: bool
    """Whether the replay resumes what an engine had learned while it ran, not what it started with."""
    lacks_under_way: bool
    """Whether the file lacks what that engine had under way, as those of earlier releases do."""

    @property
    def same(self) -> bool:
        return not self.missing and not self.added

    def text(self) -> str:
        """The result for a person."""
        unchanged = f"{count_of(self.lines, 'line')}, unchanged; the last has sha256 {self.sha256}\n"
        if self.same:
            return f"{unchanged}the replay gives the same {count_of(self.published, 'revision')} of conflicts\n"
        why = f" (the engine was restarted {count_of(self.restarts, 'time')} in that time)" if self.restarts else ""
        why += f" ({RESUMED})" if self.lacks_under_way else ""
        lines = [*(f"- {line['at']} {line['event']} {line['summary']}" for line in self.missing)]
        lines += [f"+ {line['at']} {line['event']} {line['summary']}" for line in self.added]
        return f"{unchanged}the replay differs{why}:\n" + "\n".join(lines) + "\n"


def add(commands: Commands) -> None:
    """Add the command to the command line."""
    blackbox = add_command(
        commands,
        "blackbox",
        "recordings of near misses, with the messages and decisions around each",
        "deconflict blackbox list",
        "deconflict blackbox verify data/blackbox/FILE",
    )
    parts = blackbox.add_subparsers(dest="part", required=True, metavar="PART")
    list_command = add_command(
        parts, "list", "list the near misses, and what would have avoided each", "deconflict blackbox list --data data"
    )
    list_command.add_argument("--data", type=Path, default=Path("data"), help="the service's directory")
    list_command.set_defaults(run=_list)
    verify_command = add_command(
        parts,
        "verify",
        "verify that a file is unchanged and replays to the same advisories",
        "deconflict blackbox verify data/blackbox/FILE",
    )
    verify_command.add_argument("files", nargs="+", type=Path, metavar="FILE", help="a black box")
    verify_command.set_defaults(run=_verify)


def verify(file: Path) -> Verification:
    """Verify one file. Raises `BoxError`."""
    from metrics.replay.replay import replay  # noqa: PLC0415 - brings numba

    head = _check_is_box(file)
    try:
        chain = verified(lines_of(file))
    except (ChainBrokenError, OSError, *DAMAGED) as error:
        raise BoxError(f"{file} was changed or cut off: {error}") from error
    _check_register(file, chain)
    site, replayed, reader, published = site_of(head), list[Line](), LogReader(), list[Line]()
    for event in reader.read([file]):
        if isinstance(event, BlackBoxNote) and "decided" in event.document:
            advisory = ADVISORY.validate_python(event.document["advisory"])
            if isinstance(advisory, ConflictAdvisory):
                published.append(_compared(advisory))
    events, clearances_m = reader.read([file]), [site.conflict.clearance_m]

    def add(_: float, revision: AnyAdvisory) -> None:
        if isinstance(revision, ConflictAdvisory):
            replayed.append(_compared(revision))

    replay(reader, events, site, clearances_m, on_advisory=add, start=start_of(head))
    published, replayed = _promised(head, published), _promised(head, replayed)
    return Verification(
        chain.lines,
        chain.head,
        len(published),
        [line for line in published if line not in replayed],
        [line for line in replayed if line not in published],
        int(head.get("engine_restarts", 0)),
        bool(head.get("resumed") or head.get("resumed_s")),
        bool(head.get("resumed") or (head.get("resumed_s") and not head.get("under_way"))),
    )


def _check_is_box(file: Path) -> Mapping[str, Any]:
    """The head of a black box. Raises `BoxError` if the file is none."""
    head = head_of(file)
    if head is None:
        raise BoxError(f"{file} is not a black box")
    return head


def _compared(revision: ConflictAdvisory) -> Line:
    """What must be the same in a replay."""
    return {
        "event": revision.state.value,
        "at": revision.updated_at.isoformat(),
        "id": revision.id,
        "robots": list(revision.robots),
        "clearance_m": revision.clearance_m,
        "probability": revision.probability,
        "severity": revision.severity.value,
        "time_to_conflict_s": revision.time_to_conflict_s,
        "min_separation_m": revision.min_separation_m,
        "summary": revision.summary,
    }


def _check_register(file: Path, chain: HashChain) -> None:
    """Compare a file with the register in its folder, if there is one. Raises `BoxError`."""
    before, last = Archive(file.parent).link(file.name)
    if last not in (None, chain.head):
        raise BoxError(f"{file} was rewritten: its last line has sha256 {chain.head}, but the register has {last}")
    if before not in (None, chain.first):
        raise BoxError(f"{file} does not follow the file before it in the register: a file was removed or inserted")


def _promised(head: Mapping[str, Any], lines: list[Line]) -> list[Line]:
    """The lines in the time for which the file promises that a replay gives the same advisories."""
    first, last = head["from"], head["until"]
    return [line for line in lines if first <= _stamp(line["at"]) <= last]


def _stamp(text: str) -> str:
    stamp = timestamps.parse(text)
    return timestamps.write(stamp.t_s) if stamp else ""


def _list(args: argparse.Namespace) -> int:
    if not args.data.is_dir():
        raise BoxError(f"{args.data} is no directory; give that of `serve --data`")
    boxes = Archive(args.data / FOLDER).boxes()
    if not boxes and not (args.data / FILE_NAME).exists():
        raise BoxError(f"{args.data}: has no {FILE_NAME}; expected the data directory of a service that has run")
    if not boxes:
        sys.stderr.write(f"no near misses in {args.data}\n")
    for box in boxes:
        sys.stdout.write(f"{args.data / FOLDER / box['file']}\n")
        for near_miss in box["near_misses"]:
            sys.stdout.write(f"  {near_miss['at']}  {visible(near_miss['summary'])}\n")
    return 0


def _verify(args: argparse.Namespace) -> int:
    for file in args.files:
        _check_is_box(file)
    failed = 0
    for file in args.files:
        try:
            verification = verify(file)
        except BoxError as error:
            sys.stderr.write(f"deconflict: {visible(str(error))}\n")
            failed = 1
            continue
        sys.stdout.write(f"{file}: {visible_lines(verification.text())}")
        failed |= not verification.same
    return failed
