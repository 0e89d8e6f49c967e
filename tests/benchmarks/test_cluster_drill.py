"""The documents' files of a cluster are accepted, and the drill that uses them counts what a face was warned of."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from benchmarks.cluster_drill.crossing_pairs import GAP_S, ISO, MASS, VDA, CrossingPair, made_pairs
from benchmarks.cluster_drill.drill_phases import NO_FACE, PHASES
from benchmarks.cluster_drill.drill_scores import PassedPhase, PhaseScore, score
from benchmarks.cluster_drill.drilled_machines import FILES, MACHINES, TOKENS, DrilledMachines
from benchmarks.cluster_drill.watched_face import Received, WatchedFace
from deconflict.settings import site_file
from tests.deconflict.cluster.made_cluster import SERVER, needs_server
from tests.helpers.commands import run

START_S = 1_000_000.0


@needs_server
def test_nats_accepts_the_file_of_its_servers(tmp_path: Path) -> None:
    DrilledMachines(tmp_path)
    for server in MACHINES:
        command = [str(SERVER), "-t", "-c", str(tmp_path / f"nats-{server}" / "nats.conf")]
        environment = os.environ | TOKENS | {"NATS_SERVER": f"nats-{server}"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_check_accepts_the_site_file_of_the_machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    DrilledMachines(tmp_path)
    for name, token in TOKENS.items():
        monkeypatch.setenv(name, token)
    monkeypatch.chdir(tmp_path / "machine-1")
    run("check", "site.toml")


def test_the_site_file_names_the_servers_and_the_user_of_the_other_file() -> None:
    servers, site = (FILES / "nats.conf").read_text(), site_file.load(FILES / "site.toml")
    assert site.cluster
    routes = re.findall(r'"tls://(nats-\d\.example):6222"', servers)
    assert [f"tls://{host}:4222" for host in routes] == list(site.cluster.nats)
    assert site.cluster.copies == len(routes) == len(MACHINES)
    assert f"user: {site.cluster.user}\n" in servers
    assert f"password: ${site.cluster.password.removeprefix('env:')}\n" in servers


@pytest.mark.parametrize("pair", made_pairs(12, MACHINES), ids=lambda pair: str(pair.number))
def test_the_robots_of_a_pair_are_in_one_place_when_they_meet_and_at_no_other_time(pair: CrossingPair) -> None:
    (meeting_s,) = pair.meetings_s(100.0, 100.0 + GAP_S)
    for late_s in (0.0, GAP_S, -GAP_S):
        places = [pair.pose(side, meeting_s + late_s)[:2] for side in (0, 1)]
        assert places[0] == pytest.approx(places[1], abs=1e-6)
    apart = [pair.pose(side, meeting_s + 3.0)[:2] for side in (0, 1)]
    assert abs(apart[0][0] - apart[1][0]) == pytest.approx(3.0)


def test_the_pairs_speak_all_languages_at_all_machines() -> None:
    pairs = made_pairs(12, MACHINES)
    assert {language for pair in pairs for language in pair.languages} == {MASS, VDA, ISO}
    assert {pair.machines[0] for pair in pairs if pair.kind == "at one machine"} == set(MACHINES)
    assert {pair.kind for pair in pairs} == {"at one machine", "at two machines", "at broker"}


PAIR = made_pairs(1, MACHINES)[0]
FIRST_S, SECOND_S = (START_S + t_s for t_s in PAIR.meetings_s(100.0, 100.0 + 2 * GAP_S))


def scored(*received: Received, phase: str = "quiet", mended_s: float = 0.0) -> PhaseScore:
    """Of two meetings, at a face that received this."""

    class Face(WatchedFace):
        def __init__(self) -> None:
            self._of_pair, self.health = {PAIR.uuids: list(received)}, [(FIRST_S, "ok")]

    passed = PassedPhase(PHASES[phase], NO_FACE, FIRST_S - 1, mended_s, SECOND_S + 1, 0.0)
    return score(passed, [PAIR], [Face()], START_S)


def received(before_s: float, at_s: float, advisory: str, *, is_open: bool = True) -> Received:
    return Received(at_s - before_s, advisory, is_open, at_s)


WELL = received(8, FIRST_S, "a"), received(-4, FIRST_S, "a", is_open=False), received(8, SECOND_S, "b")


def test_meetings_with_an_advisory_each_break_no_bound() -> None:
    found = scored(*WELL)
    assert (found.meetings, found.missed_at, found.health) == (2, [0], {"ok": 1})
    assert list(found.broken()) == []


def test_a_meeting_without_an_advisory_is_unwarned_and_one_with_a_late_one_is_late() -> None:
    found = scored(*WELL[:2], received(1, SECOND_S, "b"))
    assert (found.late, found.unwarned, found.charged) == (1, 0, 1)
    found = scored(*WELL[:2])
    assert (found.late, found.unwarned, found.charged) == (0, 1, 1)
    found = scored(*WELL, received(1, SECOND_S, "b", is_open=False))
    assert (found.unwarned, found.charged) == (1, 1), "it was taken back before the meeting"


def test_meetings_with_one_advisory_are_joined_and_a_meeting_with_two_is_doubled() -> None:
    assert scored(*WELL[:2], received(8, SECOND_S, "a")).joined == 1
    found = scored(*WELL, received(3, SECOND_S, "b", is_open=False), received(3, SECOND_S, "c"))
    assert (found.joined, found.doubled, len(list(found.broken()))) == (0, 1, 1)


def test_what_nobody_can_warn_of_breaks_no_bound_until_it_is_mended() -> None:
    assert scored(*WELL[:2], phase="engines-gone", mended_s=SECOND_S).charged == 0
    assert scored(*WELL[:2], phase="engines-gone", mended_s=FIRST_S).charged == 1
