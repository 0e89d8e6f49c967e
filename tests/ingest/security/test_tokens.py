import logging
from pathlib import Path

import pytest

from ingest.security.tokens import SecretError, Tokens, secret, verify_tokens

ALDER, BASALT = "alder-0123456789abcdef", "basalt-0123456789abcdef"


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    (tmp_path / "alder").write_text(f"{ALDER}\n")
    monkeypatch.setenv("BASALT_TOKEN", BASALT)
    return {"Alder": f"file:{tmp_path / 'alder'}", "Basalt": "env:BASALT_TOKEN"}


def test_only_a_token_gives_its_owner(sources: dict[str, str]) -> None:
    tokens = Tokens(sources)
    assert tokens.owner(f"Bearer {ALDER}") == "Alder"
    assert tokens.owner(f"bearer  {BASALT} ") == "Basalt"
    for wrong in (None, "", "Bearer", f"Basic {ALDER}", ALDER, f"Bearer {ALDER}x", "Bearer "):
        assert tokens.owner(wrong) is None


def test_a_changed_file_is_taken_up_and_the_old_token_ends(sources: dict[str, str], tmp_path: Path) -> None:
    tokens = Tokens(sources)
    (tmp_path / "alder").write_text("alder-changed-0123456789")
    tokens.refresh()
    assert tokens.owner("Bearer alder-changed-0123456789") == "Alder"
    assert tokens.owner(f"Bearer {ALDER}") is None


def test_a_file_that_vanishes_leaves_the_token_and_a_log_without_it(
    sources: dict[str, str], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tokens = Tokens(sources)
    (tmp_path / "alder").unlink()
    with caplog.at_level(logging.ERROR):
        tokens.refresh()
    assert tokens.owner(f"Bearer {ALDER}") == "Alder"
    assert "Alder" in caplog.text
    assert ALDER not in caplog.text


def test_a_token_that_becomes_anothers_is_not_taken_up(sources: dict[str, str], tmp_path: Path) -> None:
    tokens = Tokens(sources)
    (tmp_path / "alder").write_text(BASALT)
    tokens.refresh()
    assert tokens.owner(f"Bearer {BASALT}") == "Basalt"
    assert tokens.owner(f"Bearer {ALDER}") == "Alder"


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("env:NO_SUCH_TOKEN", "is not set"),
        ("file:/nowhere/token", "readable file"),
        ("env:SHORT", "at least 16"),
    ],
)
def test_an_unreadable_secret_says_what_to_change(source: str, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHORT", "hunter2")
    with pytest.raises(SecretError, match=expected) as error:
        secret(source)
    assert "hunter2" not in str(error.value)


def test_two_owners_of_one_token_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ONE", ALDER)
    with pytest.raises(SecretError, match="give each its own"):
        verify_tokens({"Alder": "env:ONE", "Basalt": "env:ONE"})
    assert Tokens({"Alder": "env:ONE", "Basalt": "env:ONE"}).owner(f"Bearer {ALDER}") is None


def test_an_owner_whose_token_could_never_be_read_gets_in_once_it_can(sources: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "alder").unlink()
    with pytest.raises(SecretError, match="Alder: file:"):
        verify_tokens(sources)
    tokens = Tokens(sources)
    assert tokens
    assert tokens.digest("Alder") is None
    assert tokens.owner("Bearer ") is tokens.owner(None) is tokens.owner(f"Bearer {ALDER}") is None
    assert tokens.owner(f"Bearer {BASALT}") == "Basalt"
    (tmp_path / "alder").write_text(ALDER)
    tokens.refresh()
    assert tokens.owner(f"Bearer {ALDER}") == "Alder"


def test_after_other_settings_an_owner_with_the_same_source_keeps_a_token_that_can_not_be_read(
    sources: dict[str, str], tmp_path: Path
) -> None:
    before = Tokens(sources)
    (tmp_path / "alder").write_text("")
    alder = {"Alder": sources["Alder"]}
    assert Tokens(alder, before).owner(f"Bearer {ALDER}") == "Alder"
    assert Tokens(alder, before).owner(f"Bearer {BASALT}") is None
    for others in ({}, {"Alder": "file:/nowhere"}, {"Basalt": sources["Alder"]}):
        after = Tokens(others, before)
        assert after.owner(f"Bearer {ALDER}") is None
        assert Tokens(sources, after).owner(f"Bearer {ALDER}") is None
    (tmp_path / "alder").write_text("alder-changed-0123456789")
    assert Tokens(sources, before).owner(f"Bearer {ALDER}") is None


def test_those_who_share_a_token_are_kept_out_and_all_others_get_in(sources: dict[str, str], tmp_path: Path) -> None:
    sources |= {"Corvid": "env:BASALT_TOKEN"}
    tokens = Tokens(sources)
    assert tokens.owner(f"Bearer {ALDER}") == "Alder"
    assert tokens.owner(f"Bearer {BASALT}") is None
    assert tokens.digest("Basalt") is tokens.digest("Corvid") is None
    (tmp_path / "alder").write_text("alder-changed-0123456789")
    tokens.refresh()
    assert tokens.owner("Bearer alder-changed-0123456789") == "Alder"
    assert tokens.owner(f"Bearer {ALDER}") is tokens.owner(f"Bearer {BASALT}") is None


def test_an_earlier_token_that_stays_in_use_is_given_to_no_other(
    sources: dict[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Alder is given Basalt's, and Corvid the one that Alder had."""
    corvid, dorado = "corvid-0123456789abcdef", "dorado-0123456789abcdef"
    monkeypatch.setenv("CORVID_TOKEN", corvid)
    monkeypatch.setenv("DORADO_TOKEN", dorado)
    tokens = Tokens(sources | {"Corvid": "env:CORVID_TOKEN", "Dorado": "env:DORADO_TOKEN"})
    (tmp_path / "alder").write_text(BASALT)
    monkeypatch.setenv("CORVID_TOKEN", ALDER)
    monkeypatch.setenv("DORADO_TOKEN", dorado[::-1])
    tokens.refresh()
    owners = {token: tokens.owner(f"Bearer {token}") for token in (ALDER, BASALT, corvid, dorado, dorado[::-1])}
    assert owners == {ALDER: "Alder", BASALT: "Basalt", corvid: "Corvid", dorado: None, dorado[::-1]: "Dorado"}
    (tmp_path / "alder").write_text("alder-changed-0123456789")
    tokens.refresh()
    assert [tokens.owner(f"Bearer {token}") for token in (ALDER, corvid)] == ["Corvid", None]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_secret_of_an_editor_of_windows_is_read(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes("a secret of more than enough\r\n".encode(encoding))
    assert secret(f"file:{tmp_path / 'secret'}") == "a secret of more than enough"
