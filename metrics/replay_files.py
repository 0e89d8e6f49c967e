"""The files that the commands write: whether they can be written, and what a replay writes to them as it runs."""

import argparse
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from deconflict_client.advisory import AnyAdvisory
from ingest.languages import timestamps
from ingest.recording.log_segments import under_present_name

if TYPE_CHECKING:
    from metrics.replay.engine_output import PairProbabilities
    from metrics.replay.replay import AdvisorySink, Sinks


DATABASE = b"SQLite format 3\0"
"""The first bytes of a database, as the service has some."""


class LogError(ValueError):
    """A log or a result can't be read or written. The message says what to change."""


def add_outputs(command: argparse.ArgumentParser) -> None:
    """Add the options that name the files of a replay."""
    command.add_argument(
        "--json", type=Path, metavar="OUT.json", help="write the scores to this file, not to standard output"
    )
    command.add_argument("--html", type=Path, metavar="OUT.html", help="write a report for people, in one file")
    command.add_argument(
        "--page", default="", metavar="URL", help="the operator's page, to which the cases of the report lead"
    )
    command.add_argument(
        "--advisories",
        type=Path,
        metavar="OUT.jsonl",
        help="write the live stream; of several clearances, a file for each",
    )
    command.add_argument(
        "--situations", type=Path, metavar="OUT.jsonl", help="write the revisions of situations of the first clearance"
    )
    command.add_argument(
        "--probabilities",
        type=Path,
        metavar="OUT.jsonl",
        help="write, each second, the probability of every pair that is worth a look, of the first clearance",
    )
    command.add_argument(
        "--mcap", type=Path, metavar="OUT.mcap", help="write envelopes and advisories for robot viewers"
    )


@dataclass(frozen=True, slots=True)
class ReplayFiles:
    """The files of one replay; None for those that nobody asked for."""

    json: Path | None
    html: Path | None
    advisories: Mapping[float, Path]
    """By clearance."""
    situations: Path | None
    probabilities: Path | None
    mcap: Path | None

    @classmethod
    def of(cls, args: argparse.Namespace, clearances_m: Sequence[float], name: str = "") -> "ReplayFiles":
        """The files that the options of the command name. `name` is that of one result of several."""
        outputs = args.json, args.html, args.advisories, args.situations, args.probabilities, args.mcap
        result, html, stream, situations, probabilities, mcap = (_named(out, name) if out else None for out in outputs)
        advisories: dict[float, Path] = {}
        if stream:
            advisories = {clearance_m: _of_clearance(stream, clearance_m) for clearance_m in clearances_m}
            if len(advisories) == 1:
                advisories = dict.fromkeys(advisories, stream)
        return cls(result, html, advisories, situations, probabilities, mcap)

    def paths(self) -> list[Path]:
        paths = (self.json, self.html, *self.advisories.values(), self.situations, self.probabilities, self.mcap)
        return [path for path in paths if path]

    def sinks(self, files: ExitStack) -> "Sinks":
        """Callables for what a replay publishes. They write to files that `files` closes."""
        sinks: Sinks = {}
        advisory_sinks: list[AdvisorySink] = []
        if self.advisories:
            lines = {
                clearance_m: files.enter_context(_opened(path, "w")) for clearance_m, path in self.advisories.items()
            }
            advisory_sinks.append(_Stream(lines).add)
        if self.situations:
            situations = files.enter_context(_opened(self.situations, "w"))
            sinks["on_situation"] = lambda situation: situations.writelines((situation.model_dump_json(), "\n"))
        if self.probabilities:
            sinks["on_probabilities"] = _Probabilities(files.enter_context(_opened(self.probabilities, "w"))).add
        if self.mcap:
            from metrics.report.mcap_export import McapExport  # noqa: PLC0415 - rarely needed

            export = McapExport(files.enter_context(_opened(self.mcap, "wb")))
            files.callback(export.finish)
            advisory_sinks.append(export.add_advisory)
            sinks["on_batch"] = export.add_batch

        def add(clearance_m: float, revision: AnyAdvisory) -> None:
            for sink in advisory_sinks:
                sink(clearance_m, revision)

        if advisory_sinks:
            sinks["on_advisory"] = add
        return sinks


class _Stream:
    """Writes what the advisory stream sends, numbered from 1 for each clearance."""

    def __init__(self, lines: Mapping[float, IO[str]]) -> None:
        self._lines, self._seq = lines, dict.fromkeys(lines, 0)

    def add(self, clearance_m: float, revision: AnyAdvisory) -> None:
        self._seq[clearance_m] += 1
        numbered = revision.model_copy(update={"seq": self._seq[clearance_m]})
        self._lines[clearance_m].writelines((numbered.model_dump_json(), "\n"))


class _Probabilities:
    """Writes a line for each second: the time, and the pairs with their probabilities."""

    def __init__(self, lines: IO[str]) -> None:
        self._lines = lines

    def add(self, now_s: float, probabilities: "PairProbabilities") -> None:
        pairs = [[*pair, round(probability, 9)] for pair, probability in probabilities]
        self._lines.writelines((json.dumps({"at": timestamps.write(now_s), "pairs": pairs}), "\n"))


def _of_clearance(out: Path, clearance_m: float) -> Path:
    """OUT-0.3.jsonl of OUT.jsonl. No two clearances have the same."""
    return _named(out, str(clearance_m).removesuffix(".0"))


def _named(out: Path, name: str) -> Path:
    return out.with_name(f"{out.stem}-{name}{out.suffix}") if name else out


def check_outputs(logs: Sequence[Path], outputs: Sequence[Path], site: Path | None = None) -> None:
    """Raises `LogError` if an output can't be written, or would overwrite an input, a database or another output."""
    for out in outputs:
        exists = os.access(out, os.F_OK)
        if not (os.access(out, os.W_OK) and not out.is_dir() if exists else os.access(out.parent, os.W_OK | os.X_OK)):
            raise LogError(f"{out} can't be written: give a file in an existing directory that you may write to")
        if exists and (needed := _not_to_replace(out, logs, site)):
            raise LogError(f"{out} is {needed}: give the output another name")
    for out, other in combinations(outputs, 2):
        if _is_one_file(out, other):
            raise LogError(f"{other} is named for two outputs: give each a name of its own")


def _not_to_replace(out: Path, logs: Sequence[Path], site: Path | None) -> str | None:
    """What an output is that somebody still needs."""
    if any(under_present_name(log, out.samefile) for log in logs):
        return "a log to be read"
    if site and site.exists() and out.samefile(site):
        return "the site file"
    return "a database" if out.is_file() and _is_database(out) else None


def _is_database(path: Path) -> bool:
    with suppress(OSError), path.open("rb") as file:
        return file.read(len(DATABASE)) == DATABASE
    return False


def _is_one_file(out: Path, other: Path) -> bool:
    """Whether two outputs would overwrite each other. A device as /dev/null keeps nothing."""
    if out.exists() and other.exists():
        return out.is_file() and out.samefile(other)
    return out.resolve() == other.resolve()


def create_directory(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{path} can't be made a directory: {error.strerror}") from error


def write_text(out: Path, text: str) -> None:
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise LogError(f"{out} can't be written: {error.strerror}") from error


def _opened(out: Path, mode: str) -> IO[Any]:
    try:
        return out.open(mode)
    except OSError as error:
        raise LogError(f"{out} can't be written: {error.strerror}") from error
