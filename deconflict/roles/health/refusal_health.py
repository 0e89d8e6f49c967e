"""What the service has refused, dropped or lost in the last minutes, by its counters. One rule says it of all of them.

The test of this file has the counters of the catalogue that `RULES` has not, and why.
"""

from collections import defaultdict, deque
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, NamedTuple

from deconflict.cluster.members_health import health_part
from ingest.measures.measures import joined_values

SHOWN_S = 600.0
"""What was refused or lost is said for so long."""
MOST_NAMED = 5
"""Vendors, outlets or the like that a sentence names."""
STEP_S = 10.0
"""Rises within this time are kept as one."""
REPEATED = 3
"""One attempt that failed is no fault: it is made again."""
INSISTENT = 20
"""Senders that are refused so often try again and again, and nobody hears them."""
SILENT_S = 10.0
"""If no look at the counters succeeds for so long, that is said."""
LOOK = "report the errors in the log of the operator face"
TAKEN = "stop the program that listens there (ss -ltnp shows it); the log of the role names the address"
WHO = "the log of the receiver says who, and why"


class Shown(NamedTuple):
    """A rise is said: degraded from a number within `SHOWN_S`, below it in a note."""

    words: str
    """What follows the number."""
    remedy: str
    degraded_from: float = inf
    """Never: others than the site can make it rise, and nobody else suffers from it."""


_CONNECTIONS: dict[str, Shown | None] = {
    "full": Shown(
        "connections of robots were refused because all places were taken",
        "raise the limit of open files (ulimit -n, LimitNOFILE) or receiver.max_connections; the log says which is "
        "lower",
        1,
    ),
    "no-files": Shown(
        "times no robot could connect for want of open files",
        "raise the limit of open files (ulimit -n, LimitNOFILE)",
        1,
    ),
    "face-no-files": Shown(
        "times nobody could connect to the operators' port for want of open files",
        "raise the limit of open files (ulimit -n, LimitNOFILE)",
        1,
    ),
    "unauthorised": Shown("connections were refused for want of a valid token or certificate", WHO, INSISTENT),
    "another-vendor": Shown("connections were refused that spoke for another vendor", WHO, INSISTENT),
    "tls-failed": Shown("connections of robots failed in the TLS handshake", WHO, INSISTENT),
    "another-site": Shown("connections of pages of other sites were refused", WHO),
    "replaced": Shown(
        "connections of robots were closed for newer ones",
        "a sender has more than receiver.max_connections_per_peer, or all places are taken",
    ),
    "vendor-removed": Shown("connections of vendors were closed that the site file no longer has", WHO),
    "protocol-error": Shown("connections of robots were closed after what is no WebSocket", WHO),
    "unread": Shown("connections of robots were closed because they read nothing", WHO),
    "idle": None,
    "face-idle": None,
    "face-full": Shown(
        "connections to the operators' port were refused, too many were in their handshake", "see who connects"
    ),
    "face-replaced": Shown("connections to the operators' port were closed for newer ones", "see who holds so many"),
    "face-unread": Shown("connections to the operators' port were closed that read nothing", "see who connects"),
    "face-flood": Shown("subscribers were cut off that sent too much", "see who connects"),
    "face-too-many": Shown(
        "requests of an address or person beyond its share were answered with 429", "see who asks so often"
    ),
    "face-tls-failed": Shown("connections to the operators' port failed in the TLS handshake", "see who connects"),
}
_AGAIN = "it is tried again; `files` or the log says why"

RULES: dict[str, Shown | Mapping[str, Shown | None]] = {
    "deconflict_connections_refused_total": _CONNECTIONS,
    "deconflict_messages_shed_total": Shown(
        "messages were not read, because their vendor sends too many",
        "newer ones of these robots were; have it send fewer, or raise receiver.max_messages_per_s and max_bytes_per_s",
    ),
    "deconflict_rejections_total": Shown("messages were rejected", "GET /quarantine says why, and what to change"),
    "deconflict_rejected_cut_total": Shown(
        "rejected messages were recorded in part or not", "GET /quarantine says who sends so many, and why"
    ),
    "deconflict_recorded_lines_dropped_total": Shown(
        "lines were not recorded, because the disk failed or was too slow",
        "free space or mend the disk of log/; replays and black boxes lack these lines",
        1,
    ),
    "deconflict_broker_failures_total": Shown(
        "connections to a broker of robots failed or were lost",
        "see the broker, its address and its password",
        REPEATED,
    ),
    "deconflict_dial_failures_total": Shown(
        "connections to a fleet manager failed or were lost",
        "see whether it is up, and the address in `dial` of its vendor",
        REPEATED,
    ),
    "deconflict_outlet_failures_total": Shown(
        "deliveries to an outlet failed",
        "they wait and are tried again; see whether it is up, and the log for its answer",
        REPEATED,
    ),
    "deconflict_stream_dropped_total": Shown(
        "subscribers of the stream were cut off because they stopped reading",
        "they continue where they were, once they read",
    ),
    "deconflict_losses_dropped_total": Shown(
        "losses are missing in the ledger", "`files` or the log says why losses.db takes none", 1
    ),
    "deconflict_blackboxes_total": {
        "failed": Shown("near misses have no black box, after an error", "the log says why", 1),
        "beyond": Shown(
            "near misses have no black box: too many of these vendors came at once",
            "see GET /situations for what goes on",
        ),
        "kept": None,
        "unfounded": None,
    },
    "deconflict_situation_failures_total": Shown(
        "times situations could not be made", "they began anew; report the error in the log", 1
    ),
    "deconflict_judge_failures_total": Shown(
        "times warnings could not be judged", "they are judged anew; report the error in the log", 1
    ),
    "deconflict_advice_failures_total": Shown(
        "requests for advice ended in an error", "report the error in the log", 1
    ),
    "deconflict_advice_late_total": Shown(
        "pieces of advice came too late to be given", "the engine has too little processor time if there are many"
    ),
    "deconflict_invalid_forecasts_total": {
        "floor-not-listed": Shown("forecasts were lost without their floor", "start all processes from one release", 1),
        "": Shown("forecasts could not be used", "their robots count as standing; report which robots send them"),
    },
    "deconflict_advisories_pruned_total": {
        "size": Shown(
            "cleared advisories were removed before store.keep_days", "raise store.advisories_bytes if you need them"
        ),
        "age": None,
    },
    "deconflict_port_failures_total": {
        "receiver": Shown("attempts to open the robots' port failed", TAKEN, 1),
        "operator": Shown("attempts to open the operators' port failed", TAKEN, 1),
    },
    "deconflict_faults_total": Shown(
        "faults of the program were met, and the service goes on", "report the errors in the log of the role", 1
    ),
    "deconflict_owners_failures_total": Shown("attempts to read or write owners.json failed", _AGAIN, 1),
    "deconflict_kept_messages_failures_total": Shown("attempts to read or write robots.db failed", _AGAIN, 1),
    "deconflict_learning_failures_total": Shown("attempts to read or write learned.npz failed", _AGAIN, 1),
    "deconflict_learned_parts_set_aside_total": Shown(
        "parts of what was learned were set aside", "they are learned anew; the log says why"
    ),
    "deconflict_owners_forgotten_total": Shown(
        "robots were forgotten by the register of owners", "their vendor has too many: does it make up identities?"
    ),
    "deconflict_usual_places_dropped_total": Shown(
        "places were forgotten whose usual waits were known", "there are too many places; they are learned anew"
    ),
}
"""By counter. Where reasons differ in their weight, by the first label; `""` is any other, and None is not said."""
OTHERWISE = Shown("more were refused for another reason", "the log says why")
"""Of a reason that its counter does not have here."""


Series = tuple[str, str]
"""A counter, and its first label."""


class Rises(NamedTuple):
    """How much a series has risen, from when to when."""

    by: float
    begun_s: float
    last_s: float


class RefusalHealth:
    """All times are monotonic. For one thread, but `document` may be called from any."""

    def __init__(self, *, since_start: bool, looked_s: float = inf) -> None:
        """`since_start`: the counters of all roles began with this object, so all that they have is new."""
        self._since_start = since_start
        self.looked_s = looked_s
        """When the counters of all roles were last looked at."""
        self._known: dict[str, dict[Series, float]] = {}
        """By role, the last values."""
        self._rises: dict[Series, deque[Rises]] = defaultdict(deque)
        self._sums: dict[Series, Rises] = {}
        """Within `SHOWN_S`."""

    def note_measures(self, role: str, documents: Sequence[dict[str, Any]], now_s: float) -> None:
        """Take in the measures of a role. One that has fallen began anew, or a machine has left: it is no rise."""
        new = _shown_values(documents)
        known = self._known.get(role, {} if self._since_start else new)
        self._known[role] = new
        for series, value in new.items():
            if (rise := value - known.get(series, 0.0)) > 0:
                rises = self._rises[series]
                before = rises.pop() if rises and now_s - rises[-1].begun_s < STEP_S else Rises(0.0, now_s, now_s)
                rises.append(Rises(before.by + rise, before.begun_s, now_s))
        self._sums = {series: found for series in self._rises if (found := self._sum(series, now_s)).by}

    def document(self, now_s: float) -> dict[str, Any]:
        """The part `refused_or_lost` of the health."""
        silent_s = now_s - self.looked_s
        reasons = [f"nobody has looked for {silent_s:.0f} s: {LOOK}"] if silent_s > SILENT_S else []
        notes: list[str] = []
        for rule, rises in _by_rule(self._sums).items():
            is_fault = sum(each.by for each in rises.values()) >= rule.degraded_from
            (reasons if is_fault else notes).append(_sentence(rule, rises, now_s))
        return health_part(reasons, notes=notes)

    def _sum(self, series: Series, now_s: float) -> Rises:
        rises = self._rises[series]
        while rises and now_s - rises[0].last_s >= SHOWN_S:
            rises.popleft()
        return Rises(sum(each.by for each in rises), now_s - SHOWN_S, rises[-1].last_s if rises else -inf)


def rule_of(name: str, label: str) -> Shown | None:
    """Of a counter, and of its first label if its rule depends on it; None if that is not said."""
    rule = RULES[name]
    if isinstance(rule, Shown):
        return rule
    return rule[label] if label in rule else rule.get("", OTHERWISE)


def _shown_values(documents: Sequence[dict[str, Any]]) -> dict[Series, float]:
    values: dict[Series, float] = defaultdict(float)
    for name, series in joined_values(documents).items():
        for labels, value in series.items() if name in RULES else ():
            label = labels[0] if labels else ""
            if rule_of(name, label):
                values[name, label] += value
    return values


def _by_rule(sums: Mapping[Series, Rises]) -> dict[Shown, dict[str, Rises]]:
    """By rule, what has risen; by first label, unless the rule is of this label only."""
    by_rule: dict[Shown, dict[str, Rises]] = {}
    for (name, label), rises in sums.items():
        if rule := rule_of(name, label):
            is_of_label = isinstance(RULES[name], Mapping) and label in RULES[name]
            by_rule.setdefault(rule, {})["" if is_of_label else label] = rises
    return by_rule


def _sentence(rule: Shown, rises: Mapping[str, Rises], now_s: float) -> str:
    most = sorted(filter(None, rises), key=lambda label: -rises[label].by)[:MOST_NAMED]
    named = f" ({', '.join(f'{label}: {rises[label].by:.0f}' for label in most)})" if most else ""
    ago_s = max(now_s - max(each.last_s for each in rises.values()), 0.0)
    count = sum(each.by for each in rises.values())
    return (
        f"{count:.0f} {rule.words}{named} in the last {SHOWN_S / 60:.0f} minutes, last {ago_s:.0f} s ago: {rule.remedy}"
    )
