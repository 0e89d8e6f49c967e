"""Decisions of today beside those that were kept: what changed, and which changes are intended."""

import gzip
import subprocess
import tomllib
from collections.abc import Mapping
from math import isclose
from pathlib import Path
from typing import NamedTuple

from benchmarks.decisions.decided import Decisions

TOLERANCE = 1e-6
"""Numbers that differ by less are the same: of probabilities, seconds and metres."""
MOST_CHANGED = 0.01
"""The share of a log's decisions that may be other ones, each with its reason in `INTENDED`."""
FOLDER = Path(__file__).parent
INTENDED = FOLDER / "intended.toml"
"""The changes that were meant: under the name of a log, a key of a decision and the reason."""


SITUATION = "situation "
"""How the keys of decisions on situations begin."""


class Change(NamedTuple):
    """A decision that is another one than when it was kept."""

    key: str
    kept: str | None
    """None if there was none."""
    today: str | None
    """None if there is none."""


def changes(kept: Decisions, today: Decisions) -> list[Change]:
    """All changed decisions, by key."""
    found = (Change(key, kept.get(key), today.get(key)) for key in sorted(kept.keys() | today.keys()))
    return [change for change in found if not _is_same(change.kept, change.today)]


def with_situations(kept: Decisions, today: Decisions) -> Decisions:
    """The kept decisions, but those on situations as they are today."""
    others = {key: value for key, value in kept.items() if not key.startswith(SITUATION)}
    return others | {key: value for key, value in today.items() if key.startswith(SITUATION)}


def is_within_limit(changed: list[Change], kept: Decisions) -> bool:
    return len(changed) <= MOST_CHANGED * len(kept)


def _is_same(kept: str | None, today: str | None) -> bool:
    if kept is None or today is None or kept == today:
        return kept == today
    words = kept.replace("=", " ").split(), today.replace("=", " ").split()
    return len(words[0]) == len(words[1]) and all(map(_are_same_words, *words))


def _are_same_words(kept: str, today: str) -> bool:
    if kept == today:
        return True
    try:
        return isclose(float(kept.rstrip(",")), float(today.rstrip(",")), rel_tol=0.0, abs_tol=TOLERANCE)
    except ValueError:
        return False


def intended(log: str) -> Mapping[str, str]:
    """By key of a decision of a log, why it was changed."""
    reasons: Mapping[str, str] = tomllib.loads(INTENDED.read_text(encoding="utf-8")).get(log, {})
    return reasons


def commits() -> Mapping[str, str]:
    """By line of `INTENDED`, the commit that wrote it; empty outside a checkout."""
    blame = ["git", "blame", "-s", "--", INTENDED.name]
    ended = subprocess.run(blame, cwd=FOLDER, capture_output=True, text=True, check=False)
    lines = (line.partition(" ") for line in ended.stdout.splitlines())
    return {rest.partition(") ")[2].partition(" = ")[0].strip('"'): commit for commit, _, rest in lines}


def read_kept(log: str) -> Decisions:
    """The kept decisions of a log. Raises `FileNotFoundError` if there are none."""
    text = gzip.decompress(_kept_file(log).read_bytes()).decode()
    return dict(line.split("\t") for line in text.splitlines())


def keep(log: str, decisions: Decisions) -> None:
    text = "".join(f"{key}\t{value}\n" for key, value in sorted(decisions.items()))
    _kept_file(log).write_bytes(gzip.compress(text.encode(), mtime=0))


def is_kept(log: str) -> bool:
    return _kept_file(log).exists()


def _kept_file(log: str) -> Path:
    return FOLDER / "kept" / f"{log}.tsv.gz"
