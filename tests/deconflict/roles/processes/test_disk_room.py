"""The table of the room that a data directory takes."""

import pytest

from deconflict.roles.processes.disk_room import DAYS, ROBOTS, disk_lines, kept_kinds
from deconflict.settings import overrides, site


def test_room_grows_with_robots_and_days_up_to_the_limits_of_the_site_file() -> None:
    for kind in kept_kinds(site.DEFAULT):
        for robots in ROBOTS:
            sizes = [kind.size(robots, days) for days in DAYS]
            assert sizes == sorted(sizes)
            assert sizes[-1] <= kind.most_bytes * (1 + 1e-9)
            assert sizes[-1] == pytest.approx(kind.size(robots, kind.keep_days))
        assert kind.size(1, 0.5) == pytest.approx(12 * kind.per_robot_hour)


def test_the_table_follows_the_site_file() -> None:
    _, head, _, *rows = disk_lines(site.DEFAULT)
    assert head.startswith("disk, if robots meet as often as in the demo; at most 10.9 GB")
    assert " ".join(rows[1].split()) == "100 3.1 GB 10.3 GB 10.9 GB 6 d 4 d 64 d 9 h"
    small = overrides.with_overrides(site.DEFAULT, ["recorder.enabled=false", "advisories_bytes=1000000000"])
    _, head, names, *rows = disk_lines(small)
    assert "at most 2.1 GB" in head
    assert names.split()[-3:] == ["advisories", "lost", "time"]
    assert " ".join(rows[2].split()) == "1000 1.2 GB 2.1 GB 2.1 GB 2 h 6 d"
