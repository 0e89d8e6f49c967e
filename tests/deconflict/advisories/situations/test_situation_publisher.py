"""A fault in situations holds up no advisory."""

from collections.abc import Sequence

from deconflict.advisories.situations.situation_counts import SITUATION_FAILURES
from deconflict.advisories.situations.situation_publisher import SituationPublisher
from deconflict.advisories.words.words import Spot
from deconflict_client.advisory import AdvisoryState, AnyAdvisory
from ingest.batch import FloorPoint
from ingest.measures.measures import Measures
from tests.deconflict.advisories.situations.made_situations import NOW_S, conflict
from tests.helpers.made_advisories import ROBOTS, made_advice, situation


class Places:
    """Names places, unless it is broken."""

    is_broken = False

    def describe(self, points: Sequence[FloorPoint]) -> list[Spot]:
        if self.is_broken:
            raise ArithmeticError("no such place")
        return [Spot("here")] * len(points)


def test_advisories_are_published_although_situations_fail_and_these_begin_anew() -> None:
    places, measures = Places(), Measures()
    publisher, first, second = SituationPublisher(places.describe), conflict("ab"), conflict("cd", x_m=30.0)

    def published(now_s: float, *revisions: AnyAdvisory) -> tuple[list[str], list[tuple[str, AdvisoryState]]]:
        stamped, made = publisher.stamped(revisions), publisher.revise(now_s, revisions, measures)
        return [each.id for each in stamped], [(each.id, each.state) for each in made]

    ((before, raised),) = published(NOW_S, first)[1]
    places.is_broken = True
    assert published(NOW_S + 1, second) == ([second.id], [(before, AdvisoryState.CLEARED)])
    assert measures.values[SITUATION_FAILURES][()] == 1
    places.is_broken = False
    _, made = published(NOW_S + 2)
    assert [state for _, state in made] == [raised, raised] == [AdvisoryState.RAISED] * 2
    assert before not in dict(made)


def test_advice_has_the_id_of_the_newest_open_situation_of_both_robots() -> None:
    publisher = SituationPublisher(Places().describe)
    publisher.restore(
        [situation(1), situation(2, robots=(ROBOTS[0], "x")), situation(3), situation(4, robots=("x", "y"))]
    )
    (with_other, alone, with_third) = publisher.stamped_advice(
        [made_advice(1), made_advice(2, other=None), made_advice(3, other="z")]
    )
    assert (with_other.situation_id, alone.situation_id) == ("situation-3", "situation-3")
    assert with_third.situation_id is None
