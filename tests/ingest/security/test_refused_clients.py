"""What is logged of refused clients."""

import pytest

from ingest.security.refused_clients import MOST_LOGGED, WITHIN_S, RefusedClients


def test_a_client_is_logged_once_an_hour_for_each_reason_and_so_many_at_most(caplog: pytest.LogCaptureFixture) -> None:
    now_s = 0.0
    refused = RefusedClients(lambda: now_s)
    for _ in range(3):
        refused.note("10.0.0.1", "its token is nobody's")
        refused.note("10.0.0.1", "it sends no token")
    assert [record.args[:2] for record in caplog.records if isinstance(record.args, tuple)] == [
        ("10.0.0.1", "its token is nobody's"),
        ("10.0.0.1", "it sends no token"),
    ]
    for number in range(2 * MOST_LOGGED):
        refused.note(f"10.1.{number // 256}.{number % 256}", "it sends no token")
    assert len(caplog.records) == MOST_LOGGED + 1
    assert "within this hour are not logged" in caplog.records[-1].getMessage()
    now_s = WITHIN_S + 1.0
    refused.note("10.0.0.1", "it sends no token")
    assert len(caplog.records) == MOST_LOGGED + 2
