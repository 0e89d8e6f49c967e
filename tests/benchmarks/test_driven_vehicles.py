"""People are warned of vehicles with drivers that report no path, whatever the site file says of who is on foot."""

from benchmarks.drawn_floors.driven_vehicles import PEOPLE, VEHICLES, encountered, mixed_floor

SECONDS = 40.0


def test_a_mixed_floor_is_the_same_each_time_and_has_no_paths() -> None:
    (people, vehicles), again = mixed_floor(1, SECONDS), mixed_floor(1, SECONDS)
    assert (len(people), len(vehicles)) == (PEOPLE, VEHICLES)
    assert {each.says for each in (*people, *vehicles)} == {"speed"}
    assert [each.uuid for each in (*people, *vehicles)] == [each.uuid for part in again for each in part]


def test_people_are_warned_of_as_many_driven_vehicles_and_not_of_each_other_if_the_site_file_knows_them() -> None:
    unknown, known = (encountered(2, SECONDS, is_known=is_known) for is_known in (False, True))
    assert unknown.meetings == known.meetings > 10
    assert known.warned_of >= unknown.warned_of >= 0.8 * known.meetings
    assert known.early >= unknown.early > 0.25 * known.meetings
    assert unknown.raised_of_people > known.raised_of_people == 0
