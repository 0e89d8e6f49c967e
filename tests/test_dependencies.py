"""Everything that is installed is pinned, and its licence written down."""

from tests.helpers.dependencies import ROOT, licence, needed, page, pinned

CONTAGIOUS = ("GPL", "General Public")


def test_everything_that_is_installed_is_pinned() -> None:
    assert not needed().keys() - pinned().keys()


def test_the_page_of_licences_is_as_it_is_installed() -> None:
    kept = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    assert kept == page(), "write it anew: python -m tests.helpers.dependencies > docs/dependencies.md"


def test_no_licence_is_unknown_and_none_asks_for_the_source_of_this() -> None:
    licences = {name: licence(name) for name in needed()}
    assert "unknown" not in licences.values()
    assert not [
        name for name, key in licences.items() if any(keyword in key for keyword in CONTAGIOUS) and "LGPL" not in key
    ]
