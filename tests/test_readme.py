"""What the README says is so."""

import json
import re
from pathlib import Path

import pytest

from deconflict.__main__ import parser
from deconflict_client.advisory import ADVISORY

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
ARGUMENTS = re.findall(r"^deconflict ([^#\n`]*?)\s*(?:#.*)?$", README, re.M)


def test_there_are_commands_to_check() -> None:
    assert len(ARGUMENTS) >= 4


@pytest.mark.parametrize("arguments", ARGUMENTS)
def test_each_command_is_understood(arguments: str) -> None:
    assert parser().parse_args(arguments.split()).run


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#:]+)\)", README))))
def test_each_link_leads_somewhere(target: str) -> None:
    assert (ROOT / target).exists()


def test_the_advisory_shown_is_one() -> None:
    (shown,) = re.findall(r"```json\n(.*?)```", README, re.S)
    assert ADVISORY.validate_python(json.loads(shown)).state == "raised"


@pytest.mark.parametrize("target", re.findall(r"^make (\w+)", README, re.M))
def test_each_make_target_exists(target: str) -> None:
    assert f"\n{target}:" in (ROOT / "Makefile").read_text()
