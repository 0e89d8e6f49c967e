"""Which groups an advisory is compared with."""

import pytest

from deconflict.advisories.situations.grouping import Group, Grouping
from deconflict.advisories.situations.subject import Member


def test_many_rings_of_robots_at_one_place_are_not_compared_with_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """On many levels above each other, as in a rack. A conflict between robots of two of them still joins one."""
    rings = {
        f"ring {number}": Member(0.0, "hall", 1.0, 1.0, frozenset((f"a{number}", f"b{number}")), "", False)
        for number in range(100)
    }
    grouping, compared, takes = Grouping(), list[Member](), Group.takes

    def counted(group: Group, member: Member) -> bool:
        compared.append(member)
        return takes(group, member)

    monkeypatch.setattr(Group, "takes", counted)
    assert len(grouping.update(0.0, rings)) == len(rings)
    assert len(compared) <= 2 * len(rings)
    conflict = Member(1.0, "hall", 2.0, 1.0, frozenset(("a7", "c")), "", True)
    (joined,) = grouping.update(1.0, {"conflict": conflict})
    assert set(joined.members) == {"ring 7", "conflict"}
