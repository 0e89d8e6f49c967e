from pathlib import Path
from typing import Any

import pytest

from deconflict.settings.site_file import SiteError, load
from tests.helpers.made_site import put, sound, written

SOURCE = {"name": "hall", "host": "broker"}


@pytest.mark.parametrize(
    ("sources", "problem"),
    [
        ([SOURCE, SOURCE], r"mqtt_sources\[0\]\.name: 'hall' is taken"),
        ([SOURCE | {"language": "opcua"}], r"mqtt_sources\.hall\.language: "),
        ([SOURCE | {"manufacturers": ["a/b"]}], r"mqtt_sources\.hall\.manufacturers\[0\]: "),
        ([SOURCE | {"prefixes": ["uagv/+"]}], r"mqtt_sources\.hall\.prefixes\[0\]: "),
        ([SOURCE | {"prefixes": ["uagv/v2/"]}], r"mqtt_sources\.hall\.prefixes\[0\]: "),
        ([SOURCE | {"password": "open sesame"}], "expected env:NAME or file:PATH, not the secret itself"),
        ([SOURCE | {"password": "env:A"}], r"mqtt_sources\.hall\.user: is missing"),
        ([SOURCE | {"language": "iso21423", "manufacturers": ["A"]}], "topics of iso21423 name none"),
        ([SOURCE | {"ca": "ca.pem"}], r"mqtt_sources\.hall\.ca: .* set tls = true"),
        ([SOURCE | {"retry_s": [9.0, 1.0]}], r"mqtt_sources\.hall\.retry_s: found \[9\.0, 1\.0\]"),
        ([{"name": "hall"}], r"mqtt_sources\.hall\.host: is missing"),
    ],
)
def test_an_error_names_the_key_and_what_is_wrong(sources: list[dict[str, Any]], problem: str, tmp_path: Path) -> None:
    with pytest.raises(SiteError, match=problem):
        load(written(put(sound(), "mqtt_sources", sources), tmp_path))


def test_a_cluster_hears_brokers(tmp_path: Path) -> None:
    site = put(put(sound(), "mqtt_sources", [SOURCE]), "cluster", {"nats": ["nats://a"]})
    assert load(written(site, tmp_path)).mqtt_sources[0].name == "hall"


def test_prefixes_with_a_leading_slash_and_none_are_valid(tmp_path: Path) -> None:
    site = load(written(put(sound(), "mqtt_sources", [SOURCE | {"prefixes": ["/fleet/uagv", ""]}]), tmp_path))
    assert site.mqtt_sources[0].prefixes == ("/fleet/uagv", "")
