"""How long the robots of each vendor were advised to yield: ties go against the vendor that yielded least."""

from collections.abc import Iterable, Mapping

from deconflict.advisory import AdvisoryState, AnyAdvisory


def yielded_s(advisory: AnyAdvisory) -> dict[str, float]:
    """By vendor, the holds and waits that stood when an advisory was cleared; nothing of one that is open."""
    advice = advisory.recommendation
    if advice is None or advisory.state is not AdvisoryState.CLEARED:
        return {}
    vendor_of = dict(zip(advisory.robots, advisory.vendors, strict=True))
    waits = [(one.robot, one.hold_s) for one in advice.holds] + [(one.robot, one.wait_s) for one in advice.slots]
    told: dict[str, float] = {}
    for robot, wait_s in waits:
        if robot in vendor_of and wait_s > 0:
            told[vendor_of[robot]] = told.get(vendor_of[robot], 0.0) + wait_s
    return told


class Account:
    """Seconds by vendor, over the life of the site."""

    def __init__(self, burdens_s: Mapping[str, float] | None = None) -> None:
        self.burdens_s = dict(burdens_s or {})

    def settle(self, revisions: Iterable[AnyAdvisory]) -> None:
        """Charge what stood in the advisories that these revisions clear."""
        for one in revisions:
            for vendor, wait_s in yielded_s(one).items():
                self.burdens_s[vendor] = self.burdens_s.get(vendor, 0.0) + wait_s
