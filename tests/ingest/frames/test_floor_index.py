from ingest.frames.floor_index import MOST_UNKNOWN, NOWHERE, FloorIndex
from ingest.frames.frame_registry import FrameRegistry
from ingest.settings import Datum
from tests.helpers.saying import HALL, LOFT

HALLS = FrameRegistry((Datum(id=HALL, name="Hall"),), ())


def test_floors_have_indices_in_the_order_in_which_they_are_named() -> None:
    floors = FloorIndex(HALLS)
    assert [floors.of("Alder", LOFT)[1], floors.of("Basalt", HALL)[1], floors.of("Basalt", LOFT)[1]] == [0, 1, 0]
    assert floors.ids == (LOFT, HALL)
    assert floors.of_own("Alder", HALL, "") == floors.of("Alder", HALL)
    assert floors.of_own("Alder", HALL, LOFT) == floors.of("Alder", LOFT)
    assert floors.of("Alder", "")[1] == NOWHERE


def test_renewed_frames_change_what_a_datum_means_and_not_its_index() -> None:
    floors = FloorIndex(HALLS)
    floors.of("Alder", LOFT)
    before, index = floors.of("Alder", HALL)
    floors.reconfigure(FrameRegistry((), ()))
    now, same = floors.of("Alder", HALL)
    assert (before.known, now.known) == (True, False)
    assert same == index


def test_a_vendor_brings_no_more_floors_than_there_may_be_but_may_stand_on_anothers() -> None:
    floors = FloorIndex(HALLS)
    for i in range(2 * MOST_UNKNOWN):
        floors.of("Mallory", f"hall {i}")
    assert len(floors.ids) == MOST_UNKNOWN
    last = f"hall {MOST_UNKNOWN}"
    assert floors.of("Mallory", last)[1] == NOWHERE
    assert floors.of("Alder", last)[1] == floors.of("Mallory", last)[1] == MOST_UNKNOWN
