"""Batches taken in together: nothing is lost or out of order, and the answers are those of each by itself."""

import numpy as np

from deconflict.contention.robots.batch_merging import ENOUGH, BatchMerger, MergedBatch
from ingest.batch import Batch
from tests.deconflict.contention.scenes import LINE, NOW_S, Scene, Script, aisle, resource, site
from tests.helpers.saying import LOFT, robot


def floor_of(robots: int) -> Scene:
    return Scene(site(), {f"R-{n}": Script([(0, 3.0 * n, 0)]) for n in range(robots)})


def cut(scene: Scene, t: float) -> Batch:
    for name, one in scene.robots.items():
        scene.fleet.receive(one.says(name, t), NOW_S + t, LINE)
    return scene.fleet.next_batch(NOW_S + t)


def heard(due: list[MergedBatch]) -> list[tuple[str, float]]:
    return [pair for one in due for pair in zip(one.batch.robots, one.now_s.tolist(), strict=True)]


def test_robots_wait_until_there_are_enough_of_them_and_each_keeps_its_own_tick() -> None:
    scene, gathering = floor_of(ENOUGH // 2 - 1), BatchMerger()
    batches = [cut(scene, t) for t in (0.0, 1.0, 2.0)]
    assert [len(gathering.add(batch)) for batch in batches[:2]] == [0, 0]
    assert heard(gathering.add(batches[2])) == [(name, batch.now_s) for batch in batches for name in batch.robots]
    assert gathering.flush() == []


def test_gone_robots_are_removed_before_later_batches() -> None:
    scene, gathering = floor_of(2), BatchMerger()
    here = cut(scene, 0.0)
    left = here.take(np.array([1]), gone=(robot("R-0"),))
    assert gathering.add(here) == []
    (one,) = gathering.add(left)
    assert (one.batch.robots, one.batch.gone) == ((*here.robots, here.robots[1]), left.gone)


def test_batches_with_other_floor_numbers_are_not_merged() -> None:
    gathering = BatchMerger()
    first, second = cut(floor_of(2), 0.0), cut(Scene(site(), {"L": Script([(0, 0, 0)], datum=LOFT)}), 0.0)
    assert gathering.add(first) == []
    (one,) = gathering.add(second)
    assert one.batch is first
    (rest,) = gathering.flush()
    assert rest.batch.floors == second.floors != first.floors


def test_contention_gives_the_same_revisions_however_often_it_catches_up() -> None:
    def scene() -> Scene:
        east = Script([(0, -16, 5), (40, 24, 5)], vendor="Corvid")
        comes = [Script([(0, -12, -n), (12 + n, 0, 0), (40, 0, 0)], [(12 + n, 0, 0)]) for n in range(2)]
        return Scene(
            site(resource("dock", 0, 0), aisle("lane", -8, 12, 5)),
            {"E": east, "W": Script([(0, 20, 5), (40, -20, 5)]), "A": comes[0], "B": comes[1]},
        )

    steady, asked = scene(), scene()
    for quarter in range(160):
        steady.run((quarter + 1) / 4, quarter / 4)
        asked.run((quarter + 1) / 4, quarter / 4)
        asked.engine.learned()
    assert {one.kind for one in steady.told} >= {"contention", "deadlock"}
    assert asked.told == steady.told
    assert asked.engine.learned()["stays"] == steady.engine.learned()["stays"]
