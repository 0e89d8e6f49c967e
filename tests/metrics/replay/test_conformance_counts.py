from pathlib import Path
from typing import Any

import msgspec
import pytest

from deconflict.settings.site import DEFAULT
from ingest.languages import timestamps
from ingest.languages.massrobotics.massrobotics_front_end import MassRoboticsFrontEnd
from ingest.languages.model import Identity, Rejection, Status
from ingest.languages.rules import Oddity
from ingest.recording.log_reader import LogReader
from metrics.replay.conformance_counts import conform, page
from metrics.report.conformance_report import vendor_page
from tests.helpers.saying import identity, status

NOW_S = 1_790_000_000.0


def test_departures_are_counted_by_vendor_with_what_they_mean(tmp_path: Path) -> None:
    messages = [
        identity("A-1", NOW_S),
        status("A-1", NOW_S, 1.0, 2.0, 0.0),
        status("A-1", NOW_S + 0.2, 1.0, 2.0, 0.0),
        b'{"uuid": "nonsense"}',
    ]
    lines = [
        f'{{"received":"{timestamps.write(NOW_S + n / 5)}","connection":1,"peer":"x","message":{raw.decode()}}}\n'
        for n, raw in enumerate(messages)
    ]
    refused_at = timestamps.write(NOW_S)
    refused = f'{{"received":"{refused_at}","connection":1,"peer":"x","rejected":"message-too-large","raw":"["}}\n'
    log = tmp_path / "log.jsonl"
    log.write_text("".join([*lines, refused, "torn"]))
    reader = LogReader()
    result = conform(reader, reader.read([log]), DEFAULT)
    known, unknown = sorted(result["conformance"], key=lambda vendor: vendor["vendor"] == "unknown")
    counts = {finding["rule"]: finding["count"] for vendor in (known, unknown) for finding in vendor["findings"]}
    assert (result["messages"], result["unreadable_lines"]) == (5, 1)
    assert [(row["accepted"], row["rejected"]) for row in (known, unknown)] == [(3, 1), (0, 1)]
    ranks = [(finding["rejects"], finding["count"]) for finding in known["findings"]]
    assert ranks == sorted(ranks, reverse=True)
    assert ranks[0][0], "what was rejected comes first"
    assert counts["status-too-frequent"] == counts["message-too-large"] == 1
    assert "More than one status a second" in page(result)
    examples = {finding["rule"]: finding["example"] for finding in known["findings"]}
    assert examples["status-too-frequent"] == messages[2].decode()
    html = vendor_page(known, "the standard", "log.jsonl")
    assert "<h2>status-too-frequent: 1 time, read all the same</h2>" in html
    assert html.count("<section>") == len(known["findings"])
    assert "&quot;operationalState&quot;" in html, "the message is shown as it came, and runs nothing"


def test_values_that_deviate_are_listed_below_their_rule_and_robots_without_a_position_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    odd, read = (
        Oddity("identity-missing", "location.planarDatm", "3", "not at all", "planarDatum"),
        MassRoboticsFrontEnd.read,
    )
    wrong = Oddity("uuid-unreadable", "uuid", '"7"', "not at all")

    def with_oddity(*arguments: Any) -> Any:
        message, memory = read(*arguments)
        if isinstance(message, Status):
            message = msgspec.structs.replace(message, oddities=(odd,))
        if isinstance(message, Rejection):
            message = Rejection(message.rule, message.reason, message.uuid, oddities=(wrong,))
        return message, memory

    monkeypatch.setattr(MassRoboticsFrontEnd, "read", with_oddity)
    messages = [(second, identity("A-1", NOW_S + second)) for second in range(0, 50, 10)]
    messages += [(n, status(name, NOW_S + n, 1.0)) for n in range(2) for name in ("A-2", "A-3")]
    messages.append((50, identity("A-1", NOW_S, uuid="7")))
    log = tmp_path / "log.jsonl"
    head = '{{"received":"{}","connection":1,"peer":"x","vendor":"Alder","message":{}}}\n'
    log.write_text("".join(head.format(timestamps.write(NOW_S + at_s), raw.decode()) for at_s, raw in messages))
    result = conform(LogReader(), LogReader().read([log]), DEFAULT)
    (alder,) = result["conformance"]
    lines = page(result).splitlines()
    (at,) = [number for number, line in enumerate(lines) if " identity-missing " in line]
    assert (
        lines[at + 1].strip() == "location.planarDatm: sent 3, read: not at all; did you mean planarDatum? (2 robots)"
    )
    assert '            uuid: sent "7", read: not at all' in lines
    assert lines[-1].startswith(
        "  Alder A-1 is compared with nobody: no position of it has come (heard: identity report)"
    )
    html = vendor_page(alder, "the standard", "log.jsonl")
    assert "<li>location.planarDatm: sent 3, read: not at all; did you mean planarDatum? (2 robots)</li>" in html
    assert "<h2>Compared with no other robot</h2><ul><li>Alder A-1: " in html
    assert isinstance(read(MassRoboticsFrontEnd(), messages[0][1], "", None, None)[0], Identity)


def test_a_robot_whose_recorded_statuses_were_refused_says_why(tmp_path: Path) -> None:
    bad = status("A-1", NOW_S, location=None, loction={"x": 1.0})
    messages = [(identity("A-1", NOW_S), ""), *[(bad, '"rejected":"key-missing",')] * 3]
    messages.append((status("A-2", NOW_S), '"rejected":"message-too-large",'))
    log = tmp_path / "log.jsonl"
    head = '{{"received":"{}","connection":1,"peer":"x",{}"message":{}}}\n'
    rows = [
        head.format(timestamps.write(NOW_S + at_s), mark, raw.decode()) for at_s, (raw, mark) in enumerate(messages)
    ]
    log.write_text("".join(rows))
    result = conform(LogReader(), LogReader().read([log]), DEFAULT)
    alder, unknown = sorted(result["conformance"], key=lambda vendor: vendor["vendor"])
    assert (alder["accepted"], alder["rejected"], unknown["accepted"], unknown["rejected"]) == (1, 3, 0, 1)
    text = page(result)
    assert "3 messages rejected, the last: location: is missing; loction: did you mean location?" in text
    assert '            loction: sent {"x": 1.0}, read: not used; did you mean location?' in text
