"""Who reports each robot, in the batches of a fleet."""

from pathlib import Path

import pytest

from ingest.fleet.fleet import Fleet
from ingest.fleet.recovery.log_recovery import recover
from ingest.fleet.repeat_status import load
from ingest.port.connection import Connection
from ingest.settings import Vendor
from tests.helpers import vda_saying
from tests.helpers.saying import status
from tests.ingest.fleet.made_fleet import NOW_S, fleet
from tests.ingest.fleet.recovery.made_kept_messages import kept_of

FIRST, SECOND = Connection(1, "10.0.0.1"), Connection(2, "10.0.0.2", "/Alder", "Alder", proven=True)


def sources(of: Fleet, now_s: float = NOW_S) -> tuple[str, ...]:
    return of.next_batch(now_s).sources


@pytest.mark.parametrize("fast", [False, True])
def test_a_robot_is_of_the_source_of_its_newest_status(fast: bool) -> None:
    of = fleet(Vendor(name="Alder"))
    if fast:
        of.use(load())
    for t_s, connection in ((0.0, FIRST), (1.0, FIRST), (2.0, SECOND), (3.0, SECOND), (4.0, FIRST)):
        assert of.receive(status("A-1", NOW_S + t_s, t_s), NOW_S + t_s, connection) is None
        assert sources(of, NOW_S + t_s) == (connection.source,)


def test_a_status_that_is_too_old_to_count_changes_no_source() -> None:
    of = fleet(Vendor(name="Alder"))
    of.receive(status("A-1", NOW_S), NOW_S, FIRST)
    of.receive(status("A-1", NOW_S - 5), NOW_S + 0.1, SECOND)
    assert sources(of) == (FIRST.source,)


def test_a_topic_without_a_vendor_is_of_the_one_that_the_site_file_names() -> None:
    """As in a capture of a broker."""
    of = fleet(Vendor(name="KIT"))
    of.receive(vda_saying.state(NOW_S), NOW_S, vda_saying.line("state"))
    of.receive(vda_saying.state(NOW_S), NOW_S, vda_saying.line("state", maker="Nobody"))
    assert sorted(sources(of)) == ["broker broker uagv/v2", "broker broker uagv/v2 KIT"]


@pytest.mark.parametrize("connection", [FIRST, SECOND, vda_saying.line("state")])
def test_a_source_outlasts_a_restart(tmp_path: Path, connection: Connection) -> None:
    before, again = fleet(Vendor(name="Alder")), fleet(Vendor(name="Alder"))
    raw = vda_saying.state(NOW_S) if connection.topic else status("A-1", NOW_S)
    before.receive(raw, NOW_S, connection)
    kept_of(before, tmp_path).write(NOW_S + 1, NOW_S + 1)
    recover(again, [], NOW_S + 2, kept=kept_of(again, tmp_path).read(NOW_S + 2))
    assert again.snapshot(NOW_S + 2).sources == before.snapshot(NOW_S + 2).sources
