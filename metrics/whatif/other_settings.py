"""What the service would have warned of with other settings: the same log, replayed twice."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deconflict.settings.site import Site
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay
from metrics.scoring import compare

HEAD = "A: as it is, B: with other settings. Robots drive as recorded: they are not driven again."


@dataclass(frozen=True, slots=True, eq=False)
class SettingsAnswer:
    """The scores of two replays of a log."""

    before: dict[str, Any]
    after: dict[str, Any]
    problems: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        return {"before": self.before, "after": self.after}

    def lines(self) -> list[str]:
        """The comparison for a person."""
        return [HEAD, *compare.page(self.before, self.after).splitlines()]


def settings_compared(logs: Sequence[Path], before: Site, after: Site) -> SettingsAnswer:
    """The log with these settings and with others."""
    return SettingsAnswer(_scores(logs, before), _scores(logs, after))


def _scores(logs: Sequence[Path], site: Site) -> dict[str, Any]:
    reader = LogReader()
    return replay(reader, reader.read(logs), site, [site.conflict.clearance_m])
