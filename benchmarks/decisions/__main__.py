"""The command line: `python -m benchmarks.decisions` says which decisions are others than the kept ones.

It replays each log that is here by the public command, and lists each changed decision with the reason and the commit
if it was intended. It fails if a change was not intended, or if more than 1 % of a log's decisions changed.
"""

import argparse
import sys
from collections.abc import Sequence

from benchmarks.decisions.compared import (
    changes,
    commits,
    intended,
    is_kept,
    is_within_limit,
    keep,
    read_kept,
    with_situations,
)
from benchmarks.decisions.decided import decided, scores
from benchmarks.decisions.kept_logs import KEPT_LOGS, KeptLog


def main(arguments: Sequence[str] | None = None) -> int:
    options = argparse.ArgumentParser(prog="python -m benchmarks.decisions", description=__doc__)
    names = [log.name for log in KEPT_LOGS]
    options.add_argument("--logs", nargs="+", choices=names, default=names, metavar="NAME", help=" ".join(names))
    options.add_argument("--keep", action="store_true", help="keep the decisions of logs that have none yet")
    anew = "keep the decisions on situations anew, after a change of what a situation is; no other decision is touched"
    options.add_argument("--keep-situations", action="store_true", help=anew)
    args = options.parse_args(arguments)
    as_kept = [
        _compared(log, keep_missing=args.keep, keep_situations=args.keep_situations)
        for log in KEPT_LOGS
        if log.name in args.logs
    ]
    return 0 if all(as_kept) else 1


def _compared(log: KeptLog, *, keep_missing: bool, keep_situations: bool) -> bool:
    """Print what changed; whether all of it is intended and within the limit."""
    if not (file := log.file()):
        print(f"{log.name}: not here; set DECONFLICT_RECORDINGS")
        return True
    today, result = decided(file, log.site(), log.clearance_m)
    if not is_kept(log.name):
        if keep_missing:
            keep(log.name, today)
        print(f"{log.name}: {len(today)} decisions, {'kept now' if keep_missing else 'none kept'}")
        return keep_missing
    kept, reasons = read_kept(log.name), intended(log.name)
    if keep_situations:
        kept, before = with_situations(kept, today), kept
        keep(log.name, kept)
        print(f"{log.name}: {len(changes(before, kept))} decisions on situations are kept anew")
    changed = changes(kept, today)
    commit_of = commits() if changed else {}
    print(f"{log.name}: {len(changed)} of {len(kept)} decisions changed; {scores(result)}")
    for change in changed:
        reason = reasons.get(change.key)
        note = f"intended, {commit_of.get(change.key, '')}: {reason}" if reason else "NOT INTENDED"
        print(f"  {change.key}\n    kept:  {change.kept}\n    today: {change.today}\n    {note}")
    return is_within_limit(changed, kept) and all(change.key in reasons for change in changed)


if __name__ == "__main__":
    sys.exit(main())
