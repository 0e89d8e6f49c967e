"""Which members of a cluster are there and how many are expected, as an operator face says it."""

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from deconflict.settings.cluster_settings import Cluster

if TYPE_CHECKING:
    from deconflict.cluster.nats.member_roster import NotedMember

UNHEARD = "no NATS server returns this face's own heartbeats"
REMEDY = "set cluster.ingests, engines and faces to what must be there"
SILENT_FOLLOWER = "the follower of this face does not answer"


def health_part(reasons: Iterable[str], **fields: Any) -> dict[str, Any]:
    """A part of the health: degraded if there is a reason that is not empty. `fields` follow."""
    reason = "; ".join(filter(None, reasons))
    return {**({"status": "degraded", "reason": reason} if reason else {"status": "ok"}), **fields}


def members_document(settings: Cluster, there: Iterable[str], gone: Sequence["NotedMember"]) -> dict[str, Any]:
    """The part `members` of the health. `there` are the parts of all members that are there."""
    found = Counter(there)
    away = Counter(each.part for each in gone)
    expected = {part: named or found[part] + away[part] for part, named in settings.expected().items()}
    lacking = {part: number - found[part] for part, number in expected.items() if number > found[part]}
    named = {part: [each for each in gone if each.part == part][:number] for part, number in lacking.items()}
    reasons = [f"{part}s there: {found[part]} of {expected[part]} ({_known(each)})" for part, each in named.items()]
    if reasons:
        reasons.append(f"see its log, start it or another one, or {REMEDY}")
    there_by_part = {part: found[part] for part in expected}
    away_members = [each._asdict() for members in named.values() for each in members]
    return health_part(reasons, there=there_by_part, expected=expected, gone=away_members)


def unknown_members(why: str) -> dict[str, Any]:
    """The part `members` of the health of a face that does not know them."""
    return {"status": "unknown", "reason": f"{why}, so it is unknown which members of the cluster are there"}


def _known(gone: Sequence["NotedMember"]) -> str:
    """What is known of the members of a part that are missing."""
    heard = [
        f"{member.host}, process {member.process}, was last heard of at "
        f"{time.strftime('%Y-%m-%d %H:%M:%S', time.gmtime(member.heard_s))} UTC"
        for member in gone
    ]
    return ", ".join(heard) or "no other was heard of in the last day that has not said goodbye"
