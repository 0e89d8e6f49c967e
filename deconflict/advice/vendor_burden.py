"""How long the robots of each vendor have waited by advice: of equal plans, the least burdened vendor waits."""

from collections.abc import Iterable, Mapping

from deconflict.advisory import AdvisoryState, AnyAdvisory


def yielded_s(advisory: AnyAdvisory) -> dict[str, float]:
    """By vendor, the seconds of holds and waits that a cleared advisory advised; empty if it is open."""
    advice = advisory.recommendation
    if advice is None or advisory.state is not AdvisoryState.CLEARED:
        return {}
    vendor_of = dict(zip(advisory.robots, advisory.vendors, strict=True))
    waits = [(hold.robot, hold.hold_s) for hold in advice.holds] + [(slot.robot, slot.wait_s) for slot in advice.slots]
    by_vendor: dict[str, float] = {}
    for robot, wait_s in waits:
        if robot in vendor_of and wait_s > 0:
            by_vendor[vendor_of[robot]] = by_vendor.get(vendor_of[robot], 0.0) + wait_s
    return by_vendor


class Burden:
    """Seconds waited by vendor, over the life of the site."""

    def __init__(self, burdens_s: Mapping[str, float] | None = None) -> None:
        self.burdens_s = dict(burdens_s or {})

    def charge(self, revisions: Iterable[AnyAdvisory]) -> None:
        """Add the waits of the advisories that these revisions clear."""
        for revision in revisions:
            for vendor, wait_s in yielded_s(revision).items():
                self.burdens_s[vendor] = self.burdens_s.get(vendor, 0.0) + wait_s
