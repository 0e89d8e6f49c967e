"""Whatever file a command is given, it ends soon, without a traceback: with a sentence, and exit code 2 if unfit."""

import contextlib
import gzip
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from deconflict import __main__
from deconflict.runtime.command_parsers import MISUSED
from deconflict.settings.site_file import SiteError, site_from_toml

DEEP = 200_000
LONGEST_S = 20
PACKED = gzip.compress(os.urandom(100_000))
CAPTURED = b'{"time":%s,"topic":"uagv/v2/M/S/state","payload":{"headerId":1}}\n'
CONTENTS = {
    "deep_objects.jsonl": b'{"a":' * DEEP + b"1" + b"}" * DEEP,
    "deep_lists.json": b"[" * DEEP,
    "deep.yaml": b"[" * 20_000,
    "deep.xml": b"<a>" * DEEP,
    "deep.toml": b"a=" + b"[" * 20_000,
    "late.jsonl": CAPTURED % b"1e308",
    "early.jsonl": CAPTURED % b"-1e308",
    "binary.jsonl": bytes(range(256)) * 20,
    "empty.jsonl": b"",
    "broken.jsonl.gz": PACKED[:50] + b"\xff" * 50 + PACKED[100:],
    "cut.jsonl.gz": PACKED[:5000],
    "broken.jsonl.zst": b"\x28\xb5\x2f\xfd" + b"\xfe" * 100,
    "line.jsonl": b"x" * (20 << 20),
    "box.jsonl": b'{"before":"' + b"0" * 64 + b'","blackbox":{"format":2,"site":1}}\n',
}
PLANS = {
    "repeated.yaml": b"a: &a [b, b]\n"
    + b"".join(b"%c: &%c [*%c, *%c]\n" % (n + 1, n + 1, n, n) for n in range(97, 121))
    + b"levels: *y\n",
    "itself.yaml": b"levels: &a {L1: *a}",
    "nowhere.xml": b"<model version='4.0.0' name='x'><point name='a' xPosition='1e308' yPosition='NaN'/>"
    b"<path name='c' sourcePoint='a' destinationPoint='a'/></model>",
}
FILES = [*CONTENTS, "pipe.jsonl", "folder", "/dev/zero", "n" * 300]
COMMANDS = [
    ["check", "FILE"],
    ["site", "import", "FILE"],
    ["site", "suggest", "FILE"],
    ["replay", "FILE", "--jobs", "1"],
    ["replay", "--compare", "FILE", "FILE"],
    ["conform", "FILE"],
    ["conform", "FILE", "--site", "FILE"],
    ["whatif", "--follow-advice", "FILE", "--jobs", "1"],
    ["whatif", "--follow-advice", "FILE", "--site", "FILE"],
    ["blackbox", "verify", "FILE"],
    ["blackbox", "list", "--data", "FILE"],
    ["losses", "--data", "FILE"],
    ["losses", "--site", "FILE"],
    ["export", "--data", "FILE"],
    ["senders", "http://127.0.0.1:9", "--token", "file:FILE"],
    ["senders", "https://127.0.0.1:9", "--ca", "FILE"],
    ["backup", "FILE", "copy"],
    ["serve", "FILE"],
]
HARMLESS = {("check", "empty.jsonl"), ("blackbox", "box.jsonl"), ("serve", "empty.jsonl")}
"""An empty site file is a site. A broken box is a finding."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    for name, content in CONTENTS.items():
        (folder / name).write_bytes(content)
    return folder


@pytest.fixture
def hostile(tmp_path: Path, written: Path) -> Path:
    """A folder with a name for each file: to write 20 MB for each test would take most of its time."""
    for name in CONTENTS:
        (tmp_path / name).hardlink_to(written / name)
    os.mkfifo(tmp_path / "pipe.jsonl")
    (tmp_path / "folder" / "blackbox").mkdir(parents=True)
    for name in ("log.jsonl", "log.jsonl.zst", "losses.db", "advisories.db", "learned.npz", "blackbox/register.jsonl"):
        os.mkfifo(tmp_path / "folder" / name)
    for name in ("log-2.jsonl", "blackbox/blackbox-2.jsonl.zst"):
        (tmp_path / "folder" / name).symlink_to("/dev/zero")
    return tmp_path


@contextlib.contextmanager
def ends_soon() -> Iterator[None]:
    signal.alarm(LONGEST_S)
    try:
        yield
    finally:
        signal.alarm(0)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("file", FILES)
def test_a_hostile_file_is_answered_with_a_sentence(
    command: list[str],
    file: str,
    hostile: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if (command[0], file) in HARMLESS:
        return
    monkeypatch.chdir(hostile)
    code, _ = run(command, file, monkeypatch, capsys)
    assert code == MISUSED or (code == 0 and command[:2] == ["site", "suggest"])  # without messages: no places


@pytest.mark.parametrize("file", PLANS)
def test_a_plan_that_repeats_itself_or_is_nowhere_is_answered_with_a_sentence(
    file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(file).write_bytes(PLANS[file])
    code, printed = run(["site", "import", "FILE"], file, monkeypatch, capsys)
    assert (code, printed.count("\n")) == (MISUSED, 1)


@pytest.mark.parametrize("text", [".".join(["a"] * 50_000) + "=1", "[" + " . ".join(['"a b"'] * 50_000) + "]"])
def test_a_key_of_many_parts_is_refused_at_once(text: str) -> None:
    with ends_soon(), pytest.raises(SiteError, match="too many parts"):
        site_from_toml(text.encode(), Path("site.toml"))


def run(
    command: list[str], file: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    """Exit code, and what was printed."""
    words = [part.replace("FILE", file) for part in command]
    assert __main__.parser().parse_args(words).run
    monkeypatch.setattr("sys.argv", ["deconflict", *words])
    with ends_soon():
        try:
            code = __main__.main()
        except SystemExit as ended:
            code = int(ended.code or 0)
    printed = "".join(capsys.readouterr())
    assert printed.strip()
    assert "RecursionError" not in printed
    return code, printed
