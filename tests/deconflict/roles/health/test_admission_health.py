from deconflict.roles.health.admission_health import admission_document, pairs_document
from ingest.fleet.owners.admission import PARTLY_EXAMINED, UNEXAMINED
from ingest.measures.measures import Measures


def test_health_says_how_many_robots_wait_of_which_source_and_what_to_do() -> None:
    measures = Measures()
    assert admission_document([measures.as_document()]) == {"status": "ok", "waiting": 0}
    measures.level(UNEXAMINED, {("10.0.0.7",): 30, ("broker hall uagv/v2",): 12})
    document = admission_document([measures.as_document()])
    assert (document["status"], document["waiting"]) == ("degraded", 42)
    for words in ("42 new robots", "30 of 10.0.0.7", "12 of broker hall uagv/v2", "site file"):
        assert words in document["reason"]


def test_health_says_which_robots_are_compared_with_some_others_only() -> None:
    measures = Measures()
    assert pairs_document([measures.as_document()]) == {"status": "ok", "robots": 0}
    measures.level(PARTLY_EXAMINED, {("Mallory",): 30, ("Alder",): 2})
    document = pairs_document([measures.as_document()])
    assert (document["status"], document["robots"]) == ("degraded", 32)
    for words in ("32 robots", "2 of Alder", "30 of Mallory", "GET /presence"):
        assert words in document["reason"]
