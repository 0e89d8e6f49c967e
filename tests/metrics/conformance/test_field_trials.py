"""What the command says that tries each key of each kind of message: it is what the code does."""

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.iso21423.iso_messages import RESOURCES, IsoMessage
from ingest.languages.model import Status
from ingest.languages.rules import Oddity
from ingest.languages.vda5050.vda_front_end import VdaFrontEnd
from ingest.languages.vda5050.vda_messages import KINDS, OtherMessage
from metrics.conformance.field_trials import MessageSchema, lateness, paths, plain_outcome, trials
from metrics.conformance.fields_command import field_table
from metrics.conformance.sample_messages import SAMPLE_LANGUAGES, Sample
from tests.helpers.commands import run

SAMPLES = [(language, sample) for language, known in SAMPLE_LANGUAGES.items() for sample in known.samples]


def sample_of(language: str, title: str) -> Sample:
    return next(each for each in SAMPLE_LANGUAGES[language].samples if title in (each.title, each.kind))


def ways(found: dict[str, list[str]]) -> dict[str, str]:
    """By way, what happens."""
    return {way: what for what, names in found.items() for way in names}


def test_each_language_and_each_kind_that_is_read_has_a_sample() -> None:
    assert SAMPLE_LANGUAGES.keys() == FRONT_ENDS.keys()
    read = {kind for kind, model in KINDS.items() if model is not OtherMessage}
    read |= {kind for kind, model in RESOURCES.items() if model is not IsoMessage}
    assert read | {"identityReport", "statusReport"} == {sample.kind for _, sample in SAMPLES}


@pytest.mark.parametrize(("language", "sample"), SAMPLES, ids=lambda each: getattr(each, "kind", each))
def test_each_key_that_the_code_reads_is_tried(language: str, sample: Sample) -> None:
    known = SAMPLE_LANGUAGES[language]
    tried = {path for each in known.samples if each.kind == sample.kind for path in paths(language, each)}
    read = MessageSchema(known.model(sample.kind)).paths()
    assert read
    assert tried >= set(read)


@pytest.mark.parametrize(("language", "sample"), SAMPLES, ids=lambda each: getattr(each, "kind", each))
def test_a_plain_sample_is_accepted(language: str, sample: Sample) -> None:
    plain = plain_outcome(language, sample)
    assert plain.rejected == ""
    assert plain.facts["position"] != "none"


def test_what_is_absent_odd_or_wrong_is_what_the_code_does() -> None:
    status, state = sample_of("massrobotics", "statusReport"), sample_of("vda5050", "state (2.x)")
    assert "no robot" not in str(trials("vda5050", state, ("agvPosition",)))
    absent = ways(trials("vda5050", state, ("agvPosition",))["absent"])["absent"]
    assert absent.startswith("counted: position-by-node")
    visualization = sample_of("vda5050", "visualization")
    absent = ways(trials("vda5050", visualization, ("agvPosition",))["absent"])["absent"]
    assert absent.startswith("counted: position-missing (where it was last seen)")
    assert "rejected: position-absurd" in trials("vda5050", state, ("agvPosition", "x"))["wrong"]
    uuid = trials("massrobotics", status, ("uuid",))
    assert ways(uuid["absent"])["absent"].startswith("rejected: ")
    assert ways(uuid["wrong"])["unknown word"] == "rejected: uuid-unreadable"
    battery = ways(trials("massrobotics", status, ("batteryPercentage",))["odd"])
    assert battery["as text"].startswith("counted: number-as-text")
    unused = trials("vda5050", sample_of("vda5050", "order"), ("edges", 0, "edgeId"))
    assert set(unused["absent"]) <= {"", "counted: key-absent"}


def test_what_comes_late_or_twice_is_what_the_code_does() -> None:
    late = lateness("vda5050", sample_of("vda5050", "state (2.x)"))
    assert late["again"].startswith("counted: message-repeated")
    assert late["after a newer one"].startswith("counted: message-reordered")
    assert late["retained"] == "rejected: pose-retained"
    assert lateness("vda5050", sample_of("vda5050", "factsheet"))["retained"] == ""
    assert "retained" not in lateness("massrobotics", sample_of("massrobotics", "statusReport"))


def test_how_an_odd_value_is_read_stands_beside_its_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    read = VdaFrontEnd.read

    def with_oddity(*arguments: Any) -> Any:
        message, memory = read(*arguments)
        if isinstance(message, Status) and "heading-missing" in message.findings:
            odd = Oddity("heading-missing", "agvPosition.thet_a", "0.0", "not read", "theta")
            message = msgspec.structs.replace(message, oddities=(odd,))
        return message, memory

    monkeypatch.setattr(VdaFrontEnd, "read", with_oddity)
    found = trials("vda5050", sample_of("vda5050", "state (2.x)"), ("agvPosition", "theta"))
    assert "heading-missing (not read, did you mean theta?)" in ways(found["absent"])["absent"]


def test_the_command_prints_the_table_and_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fields.json"
    run("fields", "iso21423", "--json", out)
    printed = capsys.readouterr().out
    assert printed.startswith("ISO 21423: iso21423\n  identity\n    late, again: counted: message-repeated")
    assert "\n    pose.locationPoint.x\n      absent: " in printed
    assert json.loads(out.read_text()) == field_table(["iso21423"])


def test_a_language_that_there_is_not_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(AssertionError):
        run("fields", "klingon")
    assert "klingon is none of massrobotics, vda5050, iso21423" in capsys.readouterr().err
