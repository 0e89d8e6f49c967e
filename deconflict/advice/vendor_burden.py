"""How long the robots of each vendor have waited by advice: of equal plans, the least burdened vendor waits."""

from collections.abc import Iterable, Mapping

from deconflict_client.advisory import Advisory


class Burden:
    """Seconds waited by vendor, over the life of the site."""

    def __init__(self, burdens_s: Mapping[str, float] | None = None) -> None:
        self.burdens_s = dict(burdens_s or {})

    def charge(self, revisions: Iterable[Advisory]) -> None:
        """Add the waits of the advisories that these revisions clear."""
        for revision in revisions:
            for vendor, wait_s in revision.advised_wait_s.items():
                self.burdens_s[vendor] = self.burdens_s.get(vendor, 0.0) + wait_s


def burden_ranks(burdens_s: Mapping[str, float], vendors: Iterable[str]) -> dict[str, int]:
    """By vendor, its rank by burden, from 0 for the least burdened."""
    burden_s = {vendor: burdens_s.get(vendor, 0.0) for vendor in vendors}
    rank_of = {level: rank for rank, level in enumerate(sorted(set(burden_s.values())))}
    return {vendor: rank_of[level] for vendor, level in burden_s.items()}
