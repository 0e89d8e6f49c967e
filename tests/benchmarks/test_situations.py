"""Twenty minutes of situations on a busy floor: the benchmark stops at the first id that is lost or used again."""

from benchmarks.situations import run


def test_situations_keep_their_ids_through_splits() -> None:
    figures = run(hours=0.35, robots=300, open_count=30.0, seed=1)
    assert figures["split"]
    assert figures["situations"]
