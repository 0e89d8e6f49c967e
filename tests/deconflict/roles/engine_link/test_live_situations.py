"""The situations of a running machine: made after advisories are published, as a replay makes them."""

import asyncio
import threading
from collections.abc import Sequence

import pytest

from deconflict.advisories.situations.situation_counts import SITUATION_FAILURES
from deconflict.advisories.situations.situation_lifecycle import LINGERS_S, SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.operator.store import store as stores
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store, StoreError
from deconflict.roles.engine_link.live_situations import LiveSituations
from deconflict.roles.engine_link.restoration import open_revisions
from deconflict.runtime.set_asides import SET_ASIDE, SetAsides
from deconflict.settings.shared_places import NamedArea
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ClearedCode, Location, moment
from deconflict_client.situations import AnyRevision, Situation, situations_of
from ingest.measures.measures import Measures
from ingest.settings import Datum
from tests.deconflict.advisories.situations.made_situations import NOW_S, conflict
from tests.helpers.patience import PATIENCE_S
from tests.helpers.saying import HALL


def live_situations(store: Store) -> LiveSituations:
    return LiveSituations(Site(), store, Publisher(store, Measures()))


async def send(live: LiveSituations, revisions: Sequence[AnyRevision], passes_s: Sequence[float]) -> None:
    """What the operator face does with a parcel."""
    await live.publish(revisions)
    live.follow(passes_s)


async def published(live: LiveSituations, store: Store, revisions: Sequence[AnyRevision], *passes_s: float) -> None:
    await send(live, revisions, passes_s)
    await live.settled()


def stored(store: Store) -> list[AnyRevision]:
    return list(store.after(0, 1000))


def stored_situations(store: Store) -> list[Situation]:
    return situations_of(stored(store))


async def test_an_advisory_is_published_first_and_its_next_revision_has_the_id_of_its_situation(store: Store) -> None:
    live, first = live_situations(store), conflict("ab")
    await published(live, store, [first], NOW_S)
    await published(live, store, [first.next_revision(updated_at=moment(NOW_S + 1))], NOW_S + 1)
    raised, situation, updated = stored(store)[:3]
    assert (raised.kind, situation.kind, updated.kind) == ("conflict", "situation", "conflict")
    assert (raised.situation_id, updated.situation_id) == (None, situation.id)


@pytest.fixture
def may_go_on(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Situations are made only once this is set, and of one pass at a time."""
    is_set, is_making, revise = threading.Event(), threading.Lock(), SituationLifecycle.revise

    def slow(self: SituationLifecycle, now_s: float, revisions: Sequence[AnyAdvisory]) -> list[Situation]:
        assert is_making.acquire(blocking=False), "two passes at once"
        try:
            assert is_set.wait(PATIENCE_S)
            return revise(self, now_s, revisions)
        finally:
            is_making.release()

    monkeypatch.setattr(SituationLifecycle, "revise", slow)
    return is_set


async def test_an_advisory_does_not_wait_for_situations_but_the_next_pass_does(
    store: Store, may_go_on: threading.Event
) -> None:
    live = live_situations(store)
    await send(live, [conflict("ab")], [NOW_S])
    assert [each.kind for each in stored(store)] == ["conflict"]
    following = asyncio.create_task(send(live, [conflict("cd", x_m=30.0)], [NOW_S + 0.1]))
    await asyncio.wait({following}, timeout=0.1)
    assert not following.done()
    may_go_on.set()
    await following
    assert [each.kind for each in stored(store)] == ["conflict", "situation", "conflict"]
    await live.settled()


async def test_a_parcel_that_is_sent_again_meanwhile_makes_nothing_twice(
    store: Store, may_go_on: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: list[Store] = []

    def counted(opened: Store, set_asides: SetAsides) -> list[AnyRevision]:
        reads.append(opened)
        return open_revisions(opened, set_asides)

    monkeypatch.setattr("deconflict.roles.engine_link.live_situations.open_revisions", counted)
    live = live_situations(store)
    await asyncio.gather(*(live.publish([conflict("ab")]) for _ in range(2)))
    for _ in range(2):
        live.follow([NOW_S])
    interrupted, again = (asyncio.create_task(send(live, [conflict("ab")], [NOW_S])) for _ in range(2))
    await asyncio.wait({interrupted, again}, timeout=0.1)
    interrupted.cancel()
    may_go_on.set()
    await again
    await live.settled()
    assert [(each.kind, each.revision) for each in stored(store)] == [("conflict", 1), ("situation", 1)]
    assert SITUATION_FAILURES not in live._publisher.measures.values
    assert reads == [store]


async def test_situations_are_those_of_a_replay_although_quiet_passes_are_heard_of_later(store: Store) -> None:
    live, first, second = live_situations(store), conflict("ab"), conflict("bc", x_m=3.0)
    cleared = [each.cleared_revision(NOW_S + 2, ClearedCode.PASSED, "they passed") for each in (first, second)]
    passes: dict[float, list[AnyAdvisory]] = {NOW_S + 0.1 * number: [] for number in range(round(LINGERS_S * 10) + 40)}
    passes |= {NOW_S: [first], NOW_S + 0.5: [second], NOW_S + 2.0: [*cleared]}
    lifecycle, expected, quiet_s = SituationLifecycle(PlaceNames.of(Site()).describe), list[Situation](), list[float]()
    for now_s, revisions in sorted(passes.items()):
        expected += lifecycle.revise(now_s, revisions)
        quiet_s.append(now_s)
        if revisions or len(quiet_s) == 10:
            await send(live, revisions, quiet_s)
            quiet_s = []
    await published(live, store, [], *quiet_s)
    found = [each.model_copy(update={"seq": 0}) for each in stored_situations(store)]
    assert found == expected
    assert [each.state for each in found][-1] is AdvisoryState.CLEARED
    assert len(found) >= 3


async def test_situations_are_made_of_whole_passes(store: Store) -> None:
    live = live_situations(store)
    await published(live, store, [conflict("ab")])
    assert not stored_situations(store)
    await published(live, store, [conflict("bc", x_m=3.0)], NOW_S)
    (situation,) = stored_situations(store)
    assert situation.advisories == ("conflict ab", "conflict bc")


async def test_situations_continue_over_a_restart_also_of_advisories_that_have_no_id_of_one(store: Store) -> None:
    first = conflict("ab")
    await published(live_situations(store), store, [first], NOW_S)
    (before,) = stored_situations(store)
    live = live_situations(store)
    await published(live, store, [conflict("bc", x_m=3.0, now_s=NOW_S + 5)], NOW_S + 5)
    after = stored_situations(store)[-1]
    assert (after.id, after.revision) == (before.id, 2)
    assert after.advisories == ("conflict ab", "conflict bc")


async def test_a_split_continues_over_a_restart(store: Store) -> None:
    first, second = conflict("ab", left_s=60), conflict("cd", left_s=60, x_m=6.0)
    far = Location(datum=HALL, x=60.0, y=0.0)
    await published(live_situations(store), store, [first, second], NOW_S)
    live = live_situations(store)
    await published(live, store, [second.next_revision(updated_at=moment(NOW_S + 10), location=far)], NOW_S + 10)
    before = {each.id for each in stored_situations(store)}
    await published(live_situations(store), store, [], *[NOW_S + 11 + each for each in range(30)])
    assert {each.id for each in stored_situations(store)} == before
    assert len(before) == 2


async def test_a_fault_in_what_is_restored_holds_up_no_advisory_and_leaves_nothing_open(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    await published(live_situations(store), store, [conflict("ab")], NOW_S)
    (before,) = stored_situations(store)
    with monkeypatch.context() as broken:
        broken.setattr("deconflict.advisories.situations.situation_lifecycle._restored_group", None)
        live = live_situations(store)
        await published(live, store, [conflict("cd", x_m=30.0)], NOW_S + 1)
    await published(live, store, [], NOW_S + 2)
    assert [each.id for each in stored(store) if each.kind == "conflict"] == ["conflict ab", "conflict cd"]
    assert [each.state for each in stored_situations(store) if each.id == before.id][-1] is AdvisoryState.CLEARED
    assert len({each.id for each in stored_situations(store)}) == 3
    assert live._publisher.measures.values[SITUATION_FAILURES][()] == 1


async def test_a_fault_while_situations_are_published_holds_up_no_advisory(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    live, publisher = live_situations(store), Publisher.publish

    async def broken(self: Publisher, revisions: Sequence[AnyRevision]) -> list[AnyRevision]:
        if situations_of(revisions):
            raise ArithmeticError
        return await publisher(self, revisions)

    with monkeypatch.context() as faulty:
        faulty.setattr(Publisher, "publish", broken)
        await published(live, store, [conflict("ab")], NOW_S)
    await published(live, store, [conflict("cd", x_m=30.0)], NOW_S + 0.1)
    assert [each.kind for each in stored(store)] == ["conflict", "conflict", "situation"]
    assert live._publisher.measures.values[SET_ASIDE]["unwritable",] == 1
    assert live._publisher.measures.values[SITUATION_FAILURES][()] == 1


async def test_situations_name_places_by_the_changed_site_and_are_counted(store: Store) -> None:
    live = live_situations(store)
    outline = ((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0))
    await live.renew(Site(datums=(Datum(id=HALL, name="Hall"),), areas=(NamedArea(name="Bay 4", outline_m=outline),)))
    await published(live, store, [conflict("ab")], NOW_S)
    assert "in Bay 4" in stored_situations(store)[0].summary
    assert live._publisher.measures.values["deconflict_situations_total"] == {("meeting", "raised"): 1}


async def test_situations_that_the_store_does_not_take_are_published_later(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = live_situations(store)
    await send(live, [conflict("ab")], [NOW_S])
    with monkeypatch.context() as full:
        full.setattr(stores, "MOST_PENDING", 0)
        await live.settled()
        with pytest.raises(StoreError):
            await send(live, [conflict("cd", x_m=30.0)], [NOW_S + 0.1])
    assert [each.kind for each in stored(store)] == ["conflict"]
    await published(live, store, [conflict("cd", x_m=30.0)], NOW_S + 0.1)
    assert [each.kind for each in stored(store)] == ["conflict", "conflict", "situation", "situation"]
