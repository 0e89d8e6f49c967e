"""The stored state with which an engine resumes, in pages: however much is open, no call takes long. And what is open,
with which situations resume."""

import json
from dataclasses import dataclass, field

from deconflict.operator.store.store import Store
from deconflict.runtime.parcels import packed_parcel, unpacked_parcel
from deconflict.runtime.rpc import Caller
from deconflict.runtime.set_asides import SetAsides
from deconflict_client.advisory import SITUATION, AnyAdvisory
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import AnyRevision, advice_of, advisories_of
from ingest.batch import Pair

MOST_ADVISORIES, MOST_ENCOUNTERS = 500, 5_000
"""Of one page."""
FIRST_PAIR = ("", "")


@dataclass(frozen=True, slots=True)
class StoredState:
    """What an engine needs to resume, but for what was learned."""

    burdens_s: dict[str, float]
    open: list[AnyAdvisory | RobotAdvice] = field(default_factory=list)
    """The newest revision of each open advisory, and of all open advice."""
    encounters: dict[Pair, int] = field(default_factory=dict)


def page_of_open(store: Store, after: int) -> bytes:
    """The advisories and the advice that are open and whose newest revisions follow number `after`, as a parcel; its
    head is the last number."""
    page = store.open_after(after, MOST_ADVISORIES)
    texts = (document.text.encode() for document in page if document.kind != SITUATION)
    return packed_parcel({"last": page[-1].seq if page else None}, texts)


def open_revisions(store: Store, set_asides: SetAsides) -> list[AnyRevision]:
    """The newest revision of every open advisory and situation. Raises `StoreError`."""
    found: list[AnyRevision] = []
    last = 0
    while page := store.open_after(last, MOST_ADVISORIES):
        last = page[-1].seq
        found += filter(None, (set_asides.revision_of(document.text.encode()) for document in page))
    return found


def page_of_encounters(store: Store, after: Pair) -> bytes:
    """The numbers of encounters of the pairs that follow a pair."""
    return json.dumps([[*pair, count] for pair, count in store.encounters_after(after, MOST_ENCOUNTERS)]).encode()


def stored_state(operator: Caller, set_asides: SetAsides) -> StoredState:
    """The state that the operator face has stored. Raises `LinkDownError`."""
    state = StoredState(json.loads(operator.call("burdens")))
    last: int | None = 0
    found: dict[str, AnyRevision] = {}
    while last is not None:
        head, lines = unpacked_parcel(operator.call("restore", b"%d" % last))
        last = head["last"]
        found |= {revision.id: revision for line in lines if (revision := set_asides.revision_of(line))}
    state.open.extend([*advisories_of(found.values()), *advice_of(found.values())])
    pair: Pair = FIRST_PAIR
    while page := json.loads(operator.call("encounters", json.dumps(pair).encode())):
        state.encounters.update({(a, b): count for a, b, count in page})
        pair = page[-1][0], page[-1][1]
    return state
