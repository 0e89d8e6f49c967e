"""Advice as a sentence for people."""

from deconflict_client.verbs import Side, Verb

SENTENCES: dict[Verb, str] = {
    "wait_before": "{name} should wait {place} until {other} has passed",
    "go_first": "{name} should go first, before {other}",
    "step_aside": "{name} should step aside to the place {place} and let {other} pass",
    "go_around": "{name} should drive around {other}{side}",
    "back_out": "{name} should back out to the place {place} and let {other} pass",
    "other_way": "{name} should take another way than past {other}",
}


def advice_headline(verb: Verb, name: str, other: str, place: str, side: Side | None = None) -> str:
    """What a robot should do. `place` is where, such as "3 m from Column C3 on Ground hall"; empty if there is none."""
    side_text = f", on {name}'s {side}" if side else ""
    return SENTENCES[verb].format(name=name, other=other or "the others", place=place or "where it is", side=side_text)


def advice_summary(headline: str, seconds: float, saving_s: float | None) -> str:
    """The same with its time, and with what it saves if that is known."""
    saves = f"; saves about {saving_s:.0f} s" if saving_s else ""
    return f"{headline}, within {seconds:.0f} s{saves}"
