from pathlib import Path

import pytest

from deconflict.settings.site_file import SiteError, load
from tests.helpers.made_site import put, sound, written

HOOK = {"name": "mes", "url": "http://mes.example/", "secret": "env:MES"}


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("webhooks", [HOOK, HOOK], r"webhooks\[1\]\.name: 'mes' is taken"),
        ("webhooks", [HOOK | {"name": "mqtt"}], "give each outlet a name of its own"),
        ("webhooks", [HOOK | {"secret": ""}], r"webhooks\.mes\.secret: is empty; expected env:NAME or file:PATH"),
        (
            "webhooks",
            [HOOK | {"secret": "hunter2"}],
            r"webhooks\.mes\.secret: expected env:NAME or file:PATH, not the",
        ),
        ("webhooks", [HOOK | {"url": "mes.example"}], r"webhooks\.mes\.url: "),
        ("webhooks", [HOOK | {"retry_s": [9.0, 1.0]}], r"webhooks\.mes\.retry_s: found \[9\.0, 1\.0\]"),
        ("mqtt", {"host": "broker", "topic": "all/#"}, r"mqtt\.topic: "),
        ("mqtt", {"host": "broker", "retry_s": [2.0, 1.0]}, r"mqtt\.retry_s: found \[2\.0, 1\.0\]"),
    ],
)
def test_an_invalid_outlet_is_explained(path: str, value: object, message: str, tmp_path: Path) -> None:
    with pytest.raises(SiteError, match=message) as exception_info:
        load(written(put(sound(), path, value), tmp_path))
    assert "hunter2" not in str(exception_info.value)


def test_a_valid_outlet_is_accepted(tmp_path: Path) -> None:
    site = load(written(put(put(sound(), "webhooks", [HOOK]), "mqtt", {"host": "broker"}), tmp_path))
    assert (site.webhooks[0].name, site.mqtt and site.mqtt.port) == ("mes", 1883)
