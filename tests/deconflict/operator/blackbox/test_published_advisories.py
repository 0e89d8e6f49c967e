from deconflict.operator.blackbox.blackbox_request import BoxSpan
from deconflict.operator.blackbox.blackbox_writer import published_in
from deconflict.operator.store.store import Store
from tests.helpers.made_advisories import START, made, situation

SPAN = BoxSpan(*(START.timestamp() + second for second in (100, 100, 130, 200, 400)))


def test_a_black_box_has_advisories_and_no_situations_on_disk_or_in_memory(store: Store) -> None:
    store.append([made(1), situation(1), made(3), situation(3)])
    store.accept([made(4), situation(4)])
    published = published_in(store.path, store.pending_until(SPAN.until_s), SPAN)
    assert {advisory.id for advisory in published.decided} == {"advisory-3", "advisory-4"}
    assert [advisory.id for advisory in published.open] == ["advisory-1"]
