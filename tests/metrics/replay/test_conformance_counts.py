from pathlib import Path

from deconflict.settings.site import DEFAULT
from ingest.languages import timestamps
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
    assert counts["status-too-frequent"] == counts["message-too-large"] == 1
    assert "More than one status a second" in page(result)
    examples = {finding["rule"]: finding["example"] for finding in known["findings"]}
    assert examples["status-too-frequent"] == messages[2].decode()
    html = vendor_page(known, "the standard", "log.jsonl")
    assert "<h2>status-too-frequent: 1 time, read all the same</h2>" in html
    assert html.count("<section>") == len(known["findings"])
    assert "&quot;operationalState&quot;" in html, "the message is shown as it came, and runs nothing"
