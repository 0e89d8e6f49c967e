"""The table of one run: per simulated second, so that figures are those of a cluster at full speed."""

from collections.abc import Iterable
from math import nan
from statistics import median

from benchmarks.endtoend import Usage, since
from benchmarks.slow_motion.sampling import Moment
from benchmarks.slow_motion.slow_run import Outcome

WITHIN_S = 0.025, 0.05, 0.1, 0.15, 0.25
SERVICE = ("receiver", "feed", "nats", "engine", "follower", "operator")
"""The roles of the service. The load is not one."""


def figures(outcome: Outcome) -> dict[str, str]:
    """Figures by name, as text."""
    before, after = outcome.before, outcome.after
    seconds = after.at_s - before.at_s
    return {
        "robots": f"{outcome.robots:,}",
        "engines, ingests": f"{outcome.engines}, {len(outcome.sampler.started.floors)}",
        "stretch, simulated seconds": f"{outcome.stretch:g}, {seconds:.1f}",
        "load late, s": f"{outcome.late_s:.2f}",
        **_traffic(outcome, seconds),
        **_tiles(outcome, seconds),
        **_costs(before, after, seconds),
        **_delays(outcome),
        "faults": "; ".join([f"{len(outcome.faults)}", *outcome.faults[:3]]),
    }


def _traffic(outcome: Outcome, seconds: float) -> dict[str, str]:
    before, after = outcome.before, outcome.after

    def per_s(name: str) -> float:
        return (after.varz[name] - before.varz[name]) / seconds

    def stream_per_s(name: str) -> float:
        return (after.streams[name]["last_seq"] - before.streams[name]["last_seq"]) / seconds

    accepted = (after.accepted() - before.accepted()) / seconds
    return {
        "statuses a second": f"{accepted:,.0f}",
        "parcels a second": f"{stream_per_s('rows'):,.0f}",
        "NATS messages a second in, out": f"{per_s('in_msgs'):,.0f}, {per_s('out_msgs'):,.0f}",
        "NATS MB a second in, out": f"{per_s('in_bytes') / 1e6:.1f}, {per_s('out_bytes') / 1e6:.1f}",
        "NATS bytes a status in, out": f"{per_s('in_bytes') / accepted:,.0f}, {per_s('out_bytes') / accepted:,.0f}",
        "rows kept, MB": f"{after.streams['rows']['bytes'] / 1e6:,.0f}",
        "consumers of rows": f"{after.streams['rows']['consumer_count']:,}",
        "revisions a second": f"{stream_per_s('told'):,.0f}",
        "losses' messages a second": f"{stream_per_s('lost'):,.0f}",
        "heartbeats a second": f"{stream_per_s('KV_deconflict-members'):,.0f}",
        "identity reports kept": f"{after.streams['KV_deconflict-introduced']['messages']:,}",
    }


def _tiles(outcome: Outcome, seconds: float) -> dict[str, str]:
    sampler, takeover = outcome.sampler, outcome.takeover
    passes = (outcome.after.passes - outcome.before.passes) / seconds / outcome.engines
    found = {
        "tiles of an engine": _span(outcome.tiles),
        "tiles moved, split": f"{sampler.moves}, {sum(bool(tile.path) for tile in sampler.table.owners)}",
        "robots judged by all engines / robots": f"{sum(outcome.seen) / outcome.robots:.2f}",
        "robots of an engine": _span(outcome.seen),
        "passes a second of an engine": f"{passes:.1f}",
    }
    if takeover:
        judge = " with the global judge" if takeover.was_global else ""
        found["killed engine's tiles"] = f"{takeover.tiles}{judge}"
        found["others own them after, judge them after, s"] = f"{takeover.noticed_s:.1f}, {takeover.judged_s:.1f}"
    return found


def _costs(before: Moment, after: Moment, seconds: float) -> dict[str, str]:
    found, total = {}, 0.0
    for role in (*SERVICE, "load"):
        cores = [_core_s(a, b) / seconds for a, b in zip(before.usage[role], after.usage[role], strict=True)]
        memory = [each.memory_mb for each in after.usage[role]]
        total += sum(cores) if role in SERVICE else 0.0
        each = f", busiest {max(cores):.2f}" if len(cores) > 1 else ""
        found[f"cores of {role}"] = f"{sum(cores):.2f}{each}"
        found[f"memory of {role}, MB"] = f"{sum(memory):,.0f}"
    accepted = (after.accepted() - before.accepted()) / seconds
    return {"cores of the service": f"{total:.1f}", "us a status": f"{total / accepted * 1e6:.0f}", **found}


def _delays(outcome: Outcome) -> dict[str, str]:
    sampler, latency = outcome.sampler, since(outcome.before.latency, outcome.after.latency)
    shown_s = sorted(sampler.shown_s) or [nan]
    within = [sum(latency.counts[: latency.bounds.index(bound_s) + 1]) for bound_s in WITHIN_S]
    return {
        "message to advisory p50, p99, s": f"{latency.quantile(0.5):.2f}, {latency.quantile(0.99):.2f}",
        f"messages within {', '.join(f'{bound_s:g}' for bound_s in WITHIN_S)} s": ", ".join(
            f"{count / max(sum(latency.counts), 1):.1%}" for count in within
        ),
        "decision to face p50, p99, s": f"{median(shown_s):.3f}, {shown_s[int(0.99 * len(shown_s))]:.3f}",
        "revisions at the face": f"{len(sampler.shown_s):,}",
        "oldest pass in an outbox, s": f"{sampler.delay_s:.2f}",
        "face behind the stream, median and most, s": f"{median(sampler.lags_s):.2f}, {max(sampler.lags_s):.2f}",
        "face behind the stream, revisions": f"{sampler.lag_revisions:,}",
    }


def _core_s(before: Usage, after: Usage) -> float:
    return after.core_s - before.core_s


def _span(values: Iterable[int]) -> str:
    values = sorted(values)
    return f"{values[0]:,} to {values[-1]:,}"
