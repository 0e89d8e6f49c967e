"""Limits of one advisory's document: whatever happens on a floor, it stays below `MOST_DOCUMENT_BYTES`.

Lists and texts are cut before they are compared with those of the revision before, so what is left out makes no
revision. A document within the limits is not changed. Others say how many entries they lack, as `more_robots`.
"""

from collections.abc import Collection, Sequence

from pydantic_core import to_json

from deconflict_client.advisory import Action, Hold, Recommendation, Slot
from deconflict_client.situations import MOST_ACTIONS

MOST_DOCUMENT_BYTES = 16_000
"""Reached only with names of the greatest length. With names of 30 letters a conflict has at most 8,000 bytes, and any
other advisory 10,000."""
MOST_WAITS, MOST_PLACES, MOST_HOLDS, MOST_SLOTS = 20, 20, 20, 16
MOST_NAME_BYTES, MOST_SUMMARY_BYTES, MOST_NOTE_BYTES, MOST_REASON_BYTES = 100, 2400, 2200, 300
MOST_HEADLINE_BYTES, MOST_EVENT_BYTES, MOST_ACTION_BYTES = 600, 1200, 800
"""Of a text in JSON."""
MOST_NAMED = 20
"""Robots, pairs or places that one sentence names."""
ESCAPED_BYTES = 6
"""Most bytes of a letter in JSON."""
CUT = "…"


def short_text(text: str, most_bytes: int) -> str:
    """The text, or its beginning if it has more than `most_bytes` in JSON."""
    if ESCAPED_BYTES * len(text) <= most_bytes or len(to_json(text)) - 2 <= most_bytes:
        return text
    size_bytes = len(CUT.encode())
    for index, letter in enumerate(text):
        size_bytes += len(to_json(letter)) - 2
        if size_bytes > most_bytes:
            return text[:index] + CUT
    return text


def listed(names: Sequence[str]) -> str:
    """Names in a sentence, at most `MOST_NAMED`."""
    shown = list(names[:MOST_NAMED]) + ["others"] * (len(names) > MOST_NAMED)
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"


def limited_advice(advice: Recommendation, robots: Collection[str]) -> Recommendation:
    """The advice within the limits. The holds and slots of `robots` are kept first."""
    kept = {
        "holds": _first(advice.holds, MOST_HOLDS, robots),
        "slots": _first(advice.slots, MOST_SLOTS, robots),
        "note": short_text(advice.note, MOST_NOTE_BYTES),
        "changed_because": short_text(advice.changed_because, MOST_REASON_BYTES),
        "actions": tuple(map(_short_action, advice.actions[:MOST_ACTIONS])),
    }
    more_holds, more_slots = len(advice.holds) - len(kept["holds"]), len(advice.slots) - len(kept["slots"])
    if all(getattr(advice, field) == value for field, value in kept.items()):
        return advice
    return advice.model_copy(update={**kept, "more_holds": more_holds, "more_slots": more_slots})


def _short_action(action: Action) -> Action:
    most_bytes = {"name": MOST_NAME_BYTES} | dict.fromkeys(("where", "reason", "task"), MOST_REASON_BYTES)
    short = {field: short_text(getattr(action, field), most) for field, most in most_bytes.items()}
    return action.model_copy(update=short)


def _first(entries: Sequence[Hold | Slot], most: int, robots: Collection[str]) -> tuple[Hold | Slot, ...]:
    """At most `most` entries, those of `robots` first, in their order."""
    if len(entries) <= most:
        return tuple(entries)
    own_first = sorted(range(len(entries)), key=lambda index: entries[index].robot not in robots)
    return tuple(entries[index] for index in sorted(own_first[:most]))
