"""The stored state that a new engine receives: all of it, in pages that keep the operator face responsive."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from deconflict.operator.store.store import Store
from deconflict.roles.engine_link import restoration
from deconflict.roles.engine_link.restoration import StoredState, open_revisions, stored_state
from deconflict.roles.operator_role import OperatorRole
from deconflict.roles.service import runtime_directory
from deconflict.runtime.parcels import unpacked_parcel
from deconflict.runtime.rpc import Caller
from deconflict.runtime.set_asides import SET_ASIDE, SetAsides
from deconflict.settings.site import Operator, Site
from deconflict_client.advisory import ConflictAdvisory
from deconflict_client.situations import AnyRevision
from ingest.measures.measures import Measures
from metrics.monitoring.exposition import render
from tests.helpers.made_advisories import KEEPING, cleared, cleared_situation, made, situation


def crowd(count: int) -> list[ConflictAdvisory]:
    """So many conflicts, each of a pair of its own."""
    return [made(number, robots=(f"r-{2 * number:06d}", f"r-{2 * number + 1:06d}")) for number in range(count)]


@asynccontextmanager
async def serving(data: Path) -> AsyncIterator[tuple[OperatorRole, Caller]]:
    """A role that runs, and the engine's end of its link."""
    with runtime_directory() as runtime:
        stop = asyncio.Event()
        role = OperatorRole(Site(operator=Operator(port=0), store=KEEPING), Path(runtime), data, render)
        running = asyncio.create_task(role.run(stop))
        await role.ready.wait()
        caller = Caller(Path(runtime), "operator")
        yield role, caller
        caller.close()
        stop.set()
        await running


def stored(data: Path, *revisions: AnyRevision) -> None:
    store = Store(data)
    store.append(revisions)
    store.close()


async def test_an_engine_resumes_with_every_open_advisory_and_encounter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(restoration, "MOST_ADVISORIES", 3)
    monkeypatch.setattr(restoration, "MOST_ENCOUNTERS", 2)
    first = crowd(10)
    stored(tmp_path, *first, cleared(10, robots=("x", "y"), encounter=7), *[made(0, 2, robots=first[0].robots)])
    async with serving(tmp_path) as (role, caller):
        role._store.accept([made(1, 2, robots=first[1].robots), cleared(2, robots=first[2].robots)])
        state = await asyncio.to_thread(stored_state, caller, SetAsides(Measures()))
        assert {(advisory.id, advisory.revision) for advisory in state.open} == {
            ("advisory-0", 2),
            ("advisory-1", 2),
            *((f"advisory-{number}", 1) for number in range(3, 10)),
        }
        assert state.encounters == {("x", "y"): 7} | {advisory.robots: 1 for advisory in first}


async def test_an_unreadable_advisory_keeps_no_engine_from_resuming(tmp_path: Path) -> None:
    stored(tmp_path, *crowd(3))
    measures = Measures()
    async with serving(tmp_path) as (role, caller):
        with role._store.connections.writing() as db:
            db.execute("UPDATE revisions SET document = '{}' WHERE seq = 2")
        state = await asyncio.to_thread(stored_state, caller, SetAsides(measures))
    assert [advisory.id for advisory in state.open] == ["advisory-0", "advisory-2"]
    assert measures.values[SET_ASIDE]["invalid",] == 1


async def test_thousands_of_open_advisories_are_restored_in_answers_of_bounded_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored(tmp_path, *crowd(3_000))
    pages: list[int] = []

    async with serving(tmp_path) as (_, caller):
        call = caller.call

        def counting(method: str, payload: bytes = b"") -> bytes:
            answer = call(method, payload)
            if method == "restore":
                pages.append(len(list(unpacked_parcel(answer)[1])))
            return answer

        monkeypatch.setattr(caller, "call", counting)
        state: StoredState = await asyncio.to_thread(stored_state, caller, SetAsides(Measures()))
    assert pages == [restoration.MOST_ADVISORIES] * 6 + [0], "the event loop turns between the pages"
    assert len(state.open) == len(state.encounters) == 3_000


async def test_an_engine_resumes_with_advisories_and_the_operator_face_with_situations_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(restoration, "MOST_ADVISORIES", 2)
    stored(tmp_path, situation(1), made(1), situation(2), situation(3), cleared_situation(2), made(2), situation(1, 2))
    async with serving(tmp_path) as (role, caller):
        state = await asyncio.to_thread(stored_state, caller, SetAsides(Measures()))
        first_page = await asyncio.to_thread(caller.call, "restore", b"0")
        found = open_revisions(role._store, SetAsides(Measures()))
    assert [advisory.id for advisory in state.open] == ["advisory-1", "advisory-2"]
    assert [json.loads(line)["id"] for line in unpacked_parcel(first_page)[1]] == ["advisory-1"]
    names = ["advisory-1", "situation-3", "advisory-2", "situation-1"]
    assert [(each.id, each.revision) for each in found] == list(zip(names, (1, 1, 1, 2), strict=True))
