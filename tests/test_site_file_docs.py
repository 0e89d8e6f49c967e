"""docs/site-file.md is true: it names every key with its default, and its example loads and fits."""

import json
import re
from pathlib import Path

import pytest
from pydantic_core import to_jsonable_python

from deconflict.settings import outlet_settings as outlets
from deconflict.settings import shared_places, site, site_file
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site_check import site_report
from ingest import settings
from ingest.port.brokers.mqtt_source import MqttSource

DOC = (Path(__file__).parent.parent / "docs" / "site-file.md").read_text(encoding="utf-8")
SECTIONS: dict[str, type[settings.Section]] = {
    "`[[datums]]`": settings.Datum,
    "`[[datums.reference_points]]`": settings.ReferencePoint,
    "`[datums.plan]`": settings.FloorPlan,
    "`[[vendors]]`": settings.Vendor,
    "`[[vendors.maps]]`": settings.VendorMap,
    "`[vendors.models.MODEL]`": settings.Model,
    "`[[resources]]`": shared_places.Resource,
    "`[[resources.floors]]`": shared_places.Landing,
    "`[[zones]]`": shared_places.Zone,
    "`[[areas]]`": shared_places.NamedArea,
    "`[[obstacles]]`": shared_places.Obstacle,
    "`[[operator.people]]`": site.Person,
    "`[receiver.tls]`": settings.Tls,
    "`[[mqtt_sources]]`": MqttSource,
    "`[[webhooks]]`": outlets.Webhook,
    "`[mqtt]`": outlets.Mqtt,
    "`[cluster]`": Cluster,
}
SECTIONS |= {
    f"`[{name}]`": type(field.default)
    for name, field in site.Site.model_fields.items()
    if isinstance(field.default, settings.Section)
}


def rows(heading: str) -> dict[str, tuple[str, str]]:
    """Key to default and meaning in the first table below a heading."""
    below = DOC.split(f"\n### {heading}\n", 1)[1].split("\n### ", 1)[0]
    return {
        key: (default, meaning)
        for key, default, meaning in re.findall(r"^\| `(\w+)` \| (.+?) \| (.*) \|$", below, re.M)
    }


def default_of(section: type[settings.Section], key: str) -> str:
    field = section.model_fields[key]
    if field.is_required():
        return "required"
    return "none" if field.default is None else f"`{json.dumps(to_jsonable_python(field.default))}`"


@pytest.mark.parametrize("heading", sorted(SECTIONS))
def test_every_key_of_a_section_is_there_with_its_default_and_a_meaning(heading: str) -> None:
    section = SECTIONS[heading]
    found = rows(heading)
    assert {key: default for key, (default, _) in found.items()} == {
        key: default_of(section, key) for key in section.model_fields
    }
    assert all(meaning for _, meaning in found.values())


def test_every_section_of_the_site_is_there() -> None:
    headings = {re.sub(r"\W", "", heading) for heading in SECTIONS}
    assert set(site.Site.model_fields) - {"name", "shifts_begin"} <= headings


def test_the_example_loads_and_its_map_fits(tmp_path: Path) -> None:
    example = tmp_path / "site.toml"
    example.write_text(DOC.split("```toml\n", 1)[1].split("```", 1)[0], encoding="utf-8")
    judged = site_report(site_file.load(example))
    assert judged.problems == ()
    (birch,) = judged.maps
    assert birch.fit
    assert birch.fit.affine.scales == pytest.approx((0.001, 0.001))
    assert not birch.notes
