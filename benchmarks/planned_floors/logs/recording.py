"""The output of a simulated floor: the received messages, and the truth."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.planned_floors.logs.messages import Line, write_log
from benchmarks.planned_floors.truth.floor_truth import LOG, FloorTruth

MADE = "floor.json"
"""The parameters of the floor."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A log and its truth."""

    lines: list[Line]
    truth: FloorTruth

    def save(self, directory: Path, made_of: dict[str, Any]) -> None:
        """Write the log, the truth, and what it was `made_of`, into a directory that need not exist yet."""
        directory.mkdir(parents=True, exist_ok=True)
        write_log(directory / LOG, self.lines)
        self.truth.save(directory)
        (directory / MADE).write_text(json.dumps(made_of, indent=2) + "\n")
