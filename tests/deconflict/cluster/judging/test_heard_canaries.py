"""The canaries of a cluster: the slowest ingest and the slowest engine count."""

import time
from pathlib import Path
from typing import Any

from deconflict.cluster.judging.heard_canaries import HeardCanaries
from deconflict.cluster.store_follower import StoreFollower
from deconflict.engine.canary.canary_pair import canary_batch
from deconflict.engine.canary.canary_parcel import Canary, packed
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site import Site

NOW_S = 1_790_000_000.0
BATCH = canary_batch(NOW_S)


def test_the_ingest_whose_canary_is_oldest_counts_while_it_is_there() -> None:
    canaries = HeardCanaries()
    assert canaries.oldest(()) is None
    for ingest, due_s in (("west", 1.0), ("east", 2.0), ("west", 6.0)):
        canaries.add(packed(ingest.encode(), Canary(NOW_S + due_s, BATCH)))
    assert canaries.oldest(("west", "east")) is None
    canaries.judge()
    oldest = canaries.oldest(("west", "east"))
    assert oldest
    assert (oldest["due_s"], oldest["advisory"]["kind"]) == (NOW_S + 2.0, "conflict")
    only = canaries.oldest(("west",))
    assert only
    assert only["due_s"] == NOW_S + 6.0


def test_a_face_takes_a_canary_once_every_engine_has_judged_it() -> None:
    follower = StoreFollower(Site(), Cluster(nats=("nats://127.0.0.1:4222",)), Path())

    def new(*due_s: float | None) -> dict[str, Any] | None:
        return follower._new_canary([{"canary": at_s and {"due_s": at_s, "advisory": {}}} for at_s in due_s])

    due_s = time.time() - 3.0
    assert new(due_s, None) is None
    taken = new(due_s, due_s + 1.0)
    assert taken
    assert 2.9 < time.monotonic() - taken["due_s"] < 60.0
    assert new(due_s, due_s + 2.0) is None
    assert new(due_s + 1.0, due_s + 2.0)
