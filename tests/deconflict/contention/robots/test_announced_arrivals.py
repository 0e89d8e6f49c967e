"""What is kept of announced arrivals."""

from deconflict.contention.robots.announced_arrivals import MOST_OPEN, AnnouncedArrivals


def test_of_destinations_that_pass_without_an_arrival_the_newest_are_kept() -> None:
    arrivals = AnnouncedArrivals()
    for second in range(3 * MOST_OPEN):
        assert arrivals.add("A", float(second), ("hall", 0.0, 0.0), [("hall", 9.0 + second, 0.0)], [second - 1.0]) == []
    announced_s = [announcements[0].announced_s for _, announcements in arrivals.open()]
    assert announced_s == [second - 1.0 for second in range(2 * MOST_OPEN, 3 * MOST_OPEN)]
