"""Overrides of single settings: `clearance=0.4`, `conflict.warning_s=6`, `reading.forget_after_s=120`."""

from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from typing import Any

from deconflict.settings.site import Site
from deconflict.settings.site_file import SiteError, parsed_toml, site_from_document

MOST_GUESSES = 2
UNITS = ("_m", "_s", "_mps", "_rad", "_pct", "_bytes", "_days")


def with_overrides(site: Site, changes: Iterable[str]) -> Site:
    """The site with each `KEY=VALUE` applied.

    A key is a path as in the site file. If only one key ends so, its last part is enough, with or without the unit. A
    value is TOML. Raises `SiteError`.
    """
    try:
        return site_from_document(_changed(site, changes))
    except SiteError as error:
        raise SiteError(error.problems, "--set") from error


def _changed(site: Site, changes: Iterable[str]) -> dict[str, Any]:
    """The site as a document, with the changes."""
    document = site.model_dump(mode="json", exclude_unset=True)
    for change in changes:
        name, equals, text = (part.strip() for part in change.partition("="))
        if not equals:
            raise SiteError([f"{change!r}: expected KEY=VALUE, such as clearance=0.4"])
        path = _path(name)
        section = document
        for part in path[:-1]:
            section = section.setdefault(part, {})
        section[path[-1]] = _value(name, text)
    return document


def _path(name: str) -> tuple[str, ...]:
    keys = list(_keys())
    path = tuple(name.split("."))
    if len(path) > 1:
        return path
    found = [key for key in keys if name in (key[-1], _without_unit(key[-1]))]
    if len(found) == 1:
        return found[0]
    if found:
        raise SiteError([f"{name}: may be {' or '.join('.'.join(key) for key in found)}; give the whole key"])
    raise SiteError([f"{name}: there is no such setting; {_nearest(name, keys)}"])


def _nearest(name: str, keys: Iterable[tuple[str, str]]) -> str:
    """The settings that may be meant, by their last parts."""
    by_name = {form: ".".join(key) for key in keys for form in (key[-1], _without_unit(key[-1]))}
    close = dict.fromkeys(by_name[form] for form in get_close_matches(name, by_name, MOST_GUESSES))
    return f"did you mean {' or '.join(close)}?" if close else "docs/site-file.md lists every key"


def _keys() -> Iterator[tuple[str, str]]:
    """Section and key of every setting in a section."""
    for section, field in Site.model_fields.items():
        for key in getattr(field.annotation, "model_fields", {}):
            yield section, key


def _without_unit(key: str) -> str:
    return next((key.removesuffix(unit) for unit in UNITS if key.endswith(unit)), key)


def _value(name: str, text: str) -> Any:
    try:
        return parsed_toml(f"value = {text}")["value"]
    except (ValueError, RecursionError) as error:
        raise SiteError([f"{name}: {text!r} is not a TOML value ({error}); texts need quotes"]) from error
