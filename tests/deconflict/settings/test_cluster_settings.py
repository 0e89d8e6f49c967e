"""The setting that turns a cluster on, and that nothing of it is there without."""

import subprocess
import sys

import pytest

from deconflict.roles.service import cluster_problems
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site_file import SiteError, site_from_document


def test_without_the_section_the_service_loads_nothing_of_a_cluster() -> None:
    unwanted = "{'nats', 'deconflict.cluster.nats.bus'} & set(sys.modules)"
    asked = f"import sys, deconflict.__main__; sys.exit(bool({unwanted}))"
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0


def test_a_part_needs_a_cluster() -> None:
    assert "cluster.nats" in cluster_problems(None, ["engine"])[0]
    assert cluster_problems(None, []) == []
    assert cluster_problems(Cluster(nats=("nats://127.0.0.1",)), ["engine"]) == []


@pytest.mark.parametrize("wrong", [{"nats": []}, {"nats": ["nats://a"], "name": "a.b"}, {"nats": ["a"], "tile_m": 1.0}])
def test_an_invalid_cluster_names_the_key(wrong: dict[str, object]) -> None:
    with pytest.raises(SiteError, match="cluster"):
        site_from_document({"cluster": wrong})
