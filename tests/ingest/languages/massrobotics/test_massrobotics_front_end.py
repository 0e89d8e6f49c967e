import pytest

from ingest.languages.front_ends import FRONT_ENDS, MASSROBOTICS
from tests.helpers.saying import identity, robot, status

NOW_S = 1_790_000_000.0
FRONT_END = FRONT_ENDS[MASSROBOTICS]


@pytest.mark.parametrize(
    "raw",
    [
        identity("A-1", NOW_S),
        b'{"operationalState":"idle"}',
        b'{"fleet":{"uuid":"f"},"uuid":"a","operationalState":"idle"}',
        b'{"UUID":"f","uuid":"a","operationalState":"idle"}',
    ],
    ids=["an identity", "no UUID", "another UUID within", "two spellings"],
)
def test_a_message_whose_robot_is_not_certain_is_no_status_to_overtake(raw: bytes) -> None:
    assert FRONT_END.superseded(raw, "") is None
    assert FRONT_END.superseded(status("A-1", NOW_S), "") == robot("A-1").encode()
