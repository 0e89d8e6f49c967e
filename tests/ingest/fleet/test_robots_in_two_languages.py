"""A robot that reports in two languages is one robot."""

from ingest.fleet.fleet import Fleet
from ingest.port.connection import Connection
from ingest.settings import Datum, Vendor
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL, identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, counted, fleet

KIT = Vendor(name="KIT")


def floor() -> Fleet:
    return fleet(KIT, datums=(Datum(id=vda_saying.MAP, name="Hall"), Datum(id=HALL, name="Other")))


def in_vda(of: Fleet, t_s: float) -> str | None:
    return of.receive(vda_saying.state(t_s), t_s, vda_saying.line("state"))


def in_massrobotics(of: Fleet, t_s: float) -> list[str | None]:
    named = identity("A-1", t_s, manufacturerName="KIT", robotSerialNumber="0001")
    return [of.receive(status("A-1", t_s), t_s, LINE), of.receive(named, t_s, LINE)]


def test_the_language_that_was_heard_first_counts_by_serial_number() -> None:
    of = floor()
    in_massrobotics(of, NOW_S)
    assert in_vda(of, NOW_S + 1) == "robot-in-two-languages"
    assert list(of.robots) == [robot("A-1")]
    assert counted(of, "rejections_total")["KIT", "robot-in-two-languages"] == 1


def test_a_second_robot_leaves_the_floor_once_it_says_who_it_is() -> None:
    of = floor()
    in_vda(of, NOW_S)
    assert in_massrobotics(of, NOW_S + 1) == [None, "robot-in-two-languages"]
    assert [each.language for each in of.robots.values()] == ["vda5050"]
    assert of.next_batch(NOW_S + 1).gone == (robot("A-1"),)
    assert in_massrobotics(of, NOW_S + 2) == ["robot-in-two-languages"] * 2, "its statuses are known by now"


def test_the_other_language_counts_when_the_first_has_fallen_silent() -> None:
    of = floor()
    in_massrobotics(of, NOW_S)
    later_s = NOW_S + of.reading.silent_after_s + 1
    assert in_vda(of, later_s) is None
    assert in_massrobotics(of, later_s + 1)[1] == "robot-in-two-languages"


def test_the_owner_is_heard_again_at_once_whoever_spoke_for_its_robot_while_it_was_silent() -> None:
    of, uuid, alder = fleet(Vendor(name="Alder")), robot("A-1"), Connection(7, vendor="Alder")
    of.receive(status("A-1", NOW_S), NOW_S, alder)
    later_s = NOW_S + of.reading.silent_after_s + 1
    assert of.receive(iso_saying.odometry(later_s), later_s, iso_saying.line("odometry", uuid)) is None
    assert of.robots[uuid].vendor == "Alder", "it stays its vendor's"
    assert of.receive(status("A-1", later_s + 1), later_s + 1, alder) is None
    assert of.robots[uuid].language == "massrobotics"
    forged = of.receive(iso_saying.odometry(later_s + 2), later_s + 2, iso_saying.line("odometry", uuid))
    assert forged == "robot-in-two-languages"


def test_the_same_uuid_in_two_languages_is_one_robot_and_may_change_its_language() -> None:
    of, uuid = floor(), robot("A-1")
    of.receive(status("A-1", NOW_S), NOW_S, LINE)
    pose = iso_saying.odometry(NOW_S + 1)
    assert of.receive(pose, NOW_S + 1, iso_saying.line("odometry", uuid)) == "robot-in-two-languages"
    later_s = NOW_S + of.reading.silent_after_s + 1
    assert of.receive(iso_saying.odometry(later_s), later_s, iso_saying.line("odometry", uuid)) is None
    assert of.robots[uuid].language == "iso21423"
    assert of.next_batch(later_s).robots == (uuid,)
    assert of.receive(status("A-1", later_s), later_s + 1, LINE) == "robot-in-two-languages"


def test_of_a_robot_that_states_another_serial_number_each_time_the_newest_are_known() -> None:
    of = floor()
    for number in range(50):
        named = identity("A-1", NOW_S, manufacturerName="KIT", robotSerialNumber=f"{number:04d}")
        of.receive(named, NOW_S + number / 10, LINE)
    choice = of.owners._languages
    assert {serial for _, serial in choice._by_serial} == {"0048", "0049"}
    of.receive(status("A-1", NOW_S + 6), NOW_S + 6, LINE)
    assert in_vda(of, NOW_S + 7) is None, "0001 is another robot by now"
    choice.remove(of.robots[robot("A-1")])
    assert {known.vendor for known in choice._by_serial.values()} == {"KIT"}
    assert not choice._serials.keys() & {robot("A-1")}
