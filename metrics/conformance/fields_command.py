"""The command that prints what happens to a message if one of its keys is absent, odd, late or wrong."""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from deconflict.runtime.command_parsers import MISUSED, Commands, add_command
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.visible_text import visible
from metrics.conformance.field_trials import lateness, paths, trials
from metrics.conformance.sample_messages import SAMPLE_LANGUAGES
from metrics.replay_files import check_outputs, write_text

NOTHING = "nothing changes"


def add_fields(commands: Commands) -> None:
    """Add the command to the command line."""
    command = add_command(
        commands,
        "fields",
        "print what happens to a message if one of its keys is absent, odd, late or wrong, by trying each",
        "deconflict fields",
        "deconflict fields vda5050 --json fields.json",
    )
    command.add_argument(
        "languages", nargs="*", metavar="LANGUAGE", help=f"any of {', '.join(SAMPLE_LANGUAGES)}; all if absent"
    )
    command.add_argument("--json", type=Path, metavar="OUT.json", help="also write the table to this file")
    command.set_defaults(run=_fields)


def _fields(args: argparse.Namespace) -> int:
    if unknown := [name for name in args.languages if name not in SAMPLE_LANGUAGES]:
        sys.stderr.write(f"deconflict: {visible(unknown[0])} is none of {', '.join(SAMPLE_LANGUAGES)}\n")
        return MISUSED
    check_outputs([], [args.json] if args.json else [])
    table = field_table(args.languages or [*SAMPLE_LANGUAGES])
    sys.stdout.writelines(f"{line}\n" for line in _lines(table))
    if args.json:
        write_text(args.json, json.dumps(table, indent=2) + "\n")
    return 0


def field_table(languages: Sequence[str]) -> list[dict[str, Any]]:
    """By kind of message: what happens if it is late, and by key if that is absent, odd or wrong."""
    return [
        {
            "language": language,
            "kind": sample.title or sample.kind,
            "late": lateness(language, sample),
            "fields": {_written(path): trials(language, sample, path) for path in paths(language, sample)},
        }
        for language in languages
        for sample in SAMPLE_LANGUAGES[language].samples
    ]


def _written(path: Sequence[str | int]) -> str:
    """`nodes[0].nodePosition.x`."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path).removeprefix(".")


def _lines(table: Sequence[dict[str, Any]]) -> Iterator[str]:
    language = ""
    for kind in table:
        if kind["language"] != language:
            language = kind["language"]
            yield f"{FRONT_ENDS[language].standard}: {language}"
        yield f"  {kind['kind']}"
        yield from (f"    late, {how}: {what or NOTHING}" for how, what in kind["late"].items())
        for path, found in kind["fields"].items():
            if not any(what for ways in found.values() for what in ways):
                yield f"    {path}: {NOTHING}, whatever it is"
                continue
            yield f"    {path}"
            for title, ways in found.items():
                for what, names in ways.items():
                    how = "" if title == "absent" else f", {', '.join(names)}"
                    yield f"      {title}{how}: {what or NOTHING}"
