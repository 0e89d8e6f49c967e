"""Faults of each file of the data directory: `python -m benchmarks.faulty_files [--only losses.db] [--json OUT]`.

At a start and while the service runs, each file is locked by another program, removed, read-only, or has something else
in its place, and the disk is full, read-only or gone. For each the table says what health says within 10 s, after how
many seconds a subscriber was warned of two robots that meet meanwhile, and whether all is well again after the repair.
It needs root, since disks are mounted.
"""

import argparse
import asyncio
import json
import shutil
import tempfile
import time
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import AsyncExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.attack.measuring import is_up, parts_now
from benchmarks.faulty_files import faults
from benchmarks.faulty_files.drilled_service import DrilledService, repeated_numbers

SAID_WITHIN_S, MENDED_WITHIN_S = 10.0, 90.0
APART_S = 15.0
"""From one fault to the next in one service: each brings four new robots, and 20 are examined in a minute."""
DISK_MB = 64
DATABASES = ("advisories.db", "losses.db", "robots.db")
SMALL_FILES = ("owners.json", "learned.npz", "advisories.reserved")
FOLDERS = ("log", "blackbox")
FILES_IN_FOLDERS = (
    "log/log-00000000000000001.jsonl",
    "log/log-00000000000000001.jsonl.zst",
    "blackbox/register.jsonl",
    "blackbox/pending.json",
)
DISK = "the whole directory"
REMOVED = "it was removed or replaced"
"""As health says it."""


@dataclass(frozen=True)
class Case:
    file: str
    name: str
    fault: faults.Fault
    is_at_start: bool

    def path(self, disk: Path, data: Path) -> Path:
        """What the fault is applied to."""
        is_of_disk = self.fault in (faults.full_disk, faults.read_only_disk)
        return disk if is_of_disk else data if self.file == DISK else data / self.file

    @property
    def text(self) -> str:
        return f"{self.file} | {self.name} | {'at start' if self.is_at_start else 'while running'}"


@dataclass(frozen=True)
class Outcome:
    """What happened."""

    case: str
    words: str
    """What health says of it; "" if nothing."""
    warned_s: float | None
    is_mended: bool
    restarts: int
    repeated: int
    """Numbers that the subscriber received for two different revisions."""
    lost_positions: int

    @property
    def is_good(self) -> bool:
        return bool(self.words and self.warned_s and self.is_mended and not self.restarts and not self.repeated)


def cases() -> Iterator[Case]:
    for is_at_start in (True, False):
        for file in (*DATABASES, *SMALL_FILES, *FOLDERS):
            if file in DATABASES:
                yield Case(file, "locked", faults.locked, is_at_start)
                if is_at_start:
                    yield Case(file, "locked, also for readers", faults.held_alone, is_at_start)
            if not is_at_start:
                yield Case(file, "missing", faults.missing, is_at_start)
            yield Case(file, "a file" if file in FOLDERS else "a directory", faults.blocked, is_at_start)
            yield from others_in_place(file, is_at_start)
            if file in SMALL_FILES:
                yield Case(file, "huge", faults.huge, is_at_start)
            yield Case(file, "read-only", faults.read_only, is_at_start)
        for file in FILES_IN_FOLDERS:
            yield Case(file, "a directory", faults.blocked, is_at_start)
            yield from others_in_place(file, is_at_start)
        if is_at_start:
            yield Case(DATABASES[0], "missing", faults.missing, is_at_start)
        yield Case(DISK, "full", faults.full_disk, is_at_start)
        yield Case(DISK, "missing", faults.missing_disk, is_at_start)
        if is_at_start:
            yield Case(DISK, "read-only", faults.read_only_disk, is_at_start)


def others_in_place(file: str, is_at_start: bool) -> Iterator[Case]:
    """What is neither a file nor a directory has the place of one."""
    yield Case(file, "a pipe", faults.pipe, is_at_start)
    yield Case(file, "a device", faults.device, is_at_start)
    yield Case(file, "a socket", faults.socket_file, is_at_start)


def said_of(case: Case, health: dict[str, Any]) -> str:
    """What the parts of health say that are not ok and concern the files."""
    parts = {name: health.get(name, {}) for name in ("files", "store", "recording")}
    if case.fault is not faults.missing:
        parts["files"] = without_past(parts["files"])
    bad = {name: part for name, part in parts.items() if part.get("status", "ok") != "ok"}
    reasons = [f"{name}: {part.get('reason', part['status'])}" for name, part in bad.items()]
    about = [reason for reason in reasons if case.file == DISK or case.file in reason]
    return "; ".join(about)


def without_past(files: dict[str, Any]) -> dict[str, Any]:
    """The part of health without what was removed before, which is said for ten minutes more."""
    now = {name: fault for name, fault in files.get("faults", {}).items() if REMOVED not in fault}
    reason = "; ".join(f"{name}: {fault}" for name, fault in now.items()) or files.get("reason", "")
    return files | {"reason": reason, "status": "degraded" if now else "ok"} if files.get("faults") else files


def is_well(health: dict[str, Any]) -> bool:
    """Whether nothing is wrong now. What was removed before is said for ten minutes more."""
    parts = parts_now(health)
    parts["files"] = without_past(parts.get("files", {"status": "unknown"}))
    return is_up(health) and all(part["status"] in ("ok", "begun anew") for part in parts.values())


async def drill_start(case: Case, template: Path, disk: Path) -> Outcome:
    """A service starts with the fault."""
    data = filled(template, disk)
    service = DrilledService(data)
    async with AsyncExitStack() as run:
        with case.fault(case.path(disk, data)):
            try:
                await run.enter_async_context(service.running())
            except TimeoutError:
                return Outcome(case.text, "", None, is_mended=False, restarts=0, repeated=0, lost_positions=0)
            words, warned_s = await faulty(case, service)
            if case.fault is faults.missing_disk:
                words = words or "nothing: to start in a new directory is no fault"
        return await outcome_of(case, service, words, warned_s)


async def drill_running(all_cases: Iterable[Case], template: Path, disk: Path) -> AsyncIterator[Outcome]:
    """One fault after another befalls one service."""
    data = filled(template, disk)
    async with DrilledService(data).running() as service:
        for case in all_cases:
            folder = data / case.file if case.file in FOLDERS else (data / case.file).parent
            folder.mkdir(exist_ok=True)
            with case.fault(case.path(disk, data)):
                words, warned_s = await faulty(case, service)
                if not words and case.fault is faults.missing and case.path(disk, data).exists():
                    words = "nothing: it is made anew at once, with all that it had"
            yield await outcome_of(case, service, words, warned_s)
            await asyncio.sleep(APART_S)


async def outcome_of(case: Case, service: DrilledService, words: str, warned_s: float | None) -> Outcome:
    is_mended = await is_whole(service)
    restarts = sum((await service.health()).get("restarts", {}).values())
    repeated = len(repeated_numbers(service.revisions))
    return Outcome(case.text, words, warned_s, is_mended, restarts, repeated, service.lost_positions)


def filled(template: Path, disk: Path) -> Path:
    """The data directory on a disk, with what a service has left in another."""
    data = disk / "data"
    shutil.copytree(template, data)
    return data


async def faulty(case: Case, service: DrilledService) -> tuple[str, float | None]:
    """What health says within the time, and after how long a meeting is warned of."""
    until_s, words = time.monotonic() + SAID_WITHIN_S, ""
    while not words and time.monotonic() < until_s:
        words = said_of(case, await service.health())
        await asyncio.sleep(0.2)
    return words, await service.meet()


async def is_whole(service: DrilledService) -> bool:
    """Whether all is well in time after the repair, and a meeting is warned of and stored."""
    try:
        await service.health_once(is_well, MENDED_WITHIN_S)
    except TimeoutError:
        return False
    return await service.meet() is not None


async def run(only: str) -> AsyncIterator[Outcome]:
    wanted = [case for case in cases() if only in case.text.replace(" | ", " ")]
    with tempfile.TemporaryDirectory(prefix="drill-") as name:
        template = Path(name) / "template"
        async with DrilledService(template).running() as service:
            await service.meet()
            await asyncio.sleep(7)
        (template / "blackbox").mkdir(exist_ok=True)
        for number, case in enumerate(case for case in wanted if case.is_at_start):
            with faults.disk_at(Path(name) / f"disk{number}", DISK_MB) as disk:
                yield await drill_start(case, template, disk)
        while_running = [case for case in wanted if not case.is_at_start]
        if while_running:
            with faults.disk_at(Path(name) / "disk", DISK_MB) as disk:
                async for outcome in drill_running(while_running, template, disk):
                    yield outcome


async def print_table(only: str) -> list[Outcome]:
    outcomes = []
    async for outcome in run(only):
        outcomes.append(outcome)
        print(row_of(outcome), flush=True)
    return outcomes


def row_of(outcome: Outcome) -> str:
    warned = "never" if outcome.warned_s is None else f"{outcome.warned_s:.1f} s"
    again = "yes" if outcome.is_mended else "NO"
    counts = f"{outcome.restarts} | {outcome.repeated} | {outcome.lost_positions}"
    return f"| {outcome.case} | {outcome.words or 'NOTHING'} | {warned} | {again} | {counts} |"


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="only cases with this text, as 'losses.db locked'")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    print(
        "| file | fault | when | health within 10 s | warned after | whole again | restarts | repeated numbers | 4416 |"
    )
    print("| --- |" + " --- |" * 8)
    outcomes = asyncio.run(print_table(args.only))
    if args.json:
        args.json.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=2) + "\n")
    bad = [outcome.case for outcome in outcomes if not outcome.is_good]
    print(f"\n{len(outcomes) - len(bad)} of {len(outcomes)} as promised", *bad, sep="\n")
    return bool(bad)


if __name__ == "__main__":
    raise SystemExit(main())
