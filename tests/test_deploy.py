"""The unit file is one that systemd accepts and calls well shut in; the container file takes the same steps.

The documents install what both need, also without a network."""

import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest
import trustme
import yaml

from deconflict.__main__ import parser
from deconflict.operator.http.access import verify_credentials
from deconflict.roles.processes.role_process import STOP_TIMEOUT_S
from deconflict.roles.processes.supervisor import PARTS
from deconflict.settings.site import DEFAULT, Operator, Site
from ingest.security.tokens import SecretError
from ingest.settings import Tls, Vendor

ROOT = Path(__file__).parent.parent
COMPOSE, MONITORING = ROOT / "deploy" / "compose.yaml", ROOT / "deploy" / "monitoring"
UNIT, CONTAINER = ROOT / "deploy" / "deconflict.service", ROOT / "Containerfile"
ENVIRONMENT = "/etc/deconflict/environment"
NOBODY = 65534
needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


def analyze(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["systemd-analyze", *arguments], capture_output=True, text=True, check=False)


@needs_systemd
def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    runnable = tmp_path / UNIT.name
    runnable.write_text(re.sub(r"ExecStart=\S+", "ExecStart=/bin/true", UNIT.read_text()))
    drop_in = tmp_path / f"{UNIT.name}.d" / "override.conf"
    drop_in.parent.mkdir()
    drop_in.write_text(f"[Service]\n{handed_over()[0]}\n")
    judged = analyze("verify", "--man=no", str(runnable))
    assert (judged.returncode, judged.stderr) == (0, "")


def handed_over() -> tuple[str, str]:
    """The line of the document that has systemd hand a secret over, and the source that the site file names."""
    document = (ROOT / "docs" / "operation.md").read_text()
    line, source = re.search(r"`(LoadCredential=\S+)`", document), re.search(r'`token = "(file:[^"]+)"`', document)
    assert line
    assert source
    return line[1], source[1]


def test_the_site_file_names_the_secret_where_systemd_puts_it() -> None:
    line, source = handed_over()
    name = line.partition("=")[2].partition(":")[0]
    assert source == f"file:/run/credentials/{UNIT.name}/{name}"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_secrets_and_keys_that_systemd_hands_over_are_read_by_the_user_of_the_unit_alone() -> None:
    with tempfile.TemporaryDirectory() as home:
        credentials, source = Path(home) / "credentials", Path(home) / "alder"
        credentials.mkdir()
        for place in (source, credentials / "alder"):
            place.write_text("alder-0123456789abcdef\n")
        trustme.CA().issue_cert("localhost").private_key_and_cert_chain_pem.write_to_path(str(credentials / "site"))
        for file in credentials.iterdir():
            file.chmod(0o400)
            os.chown(file, NOBODY, NOBODY)
        source.chmod(0o600)
        credentials.chmod(0o500)
        for folder in (credentials, Path(home)):
            os.chown(folder, NOBODY, NOBODY)

        def site(token: Path) -> Site:
            tls = Tls(certificate=str(credentials / "site"))
            return Site(vendors=(Vendor(name="Alder", token=f"file:{token}"),), operator=Operator(tls=tls))

        os.seteuid(NOBODY)
        try:
            verify_credentials(site(credentials / "alder"))
            with pytest.raises(SecretError, match="PermissionError; expected a readable file"):
                verify_credentials(site(source))
        finally:
            os.seteuid(0)


@needs_systemd
def test_the_unit_is_shut_in() -> None:
    judged = analyze("security", "--offline=true", str(UNIT)).stdout
    exposure = re.search(r"exposure level for \S+: ([\d.]+)", judged)
    assert exposure, judged
    assert float(exposure[1]) <= 2.0


def test_a_reload_asks_the_service_to_read_its_site_file_again() -> None:
    assert re.search(r"^ExecReload=/bin/kill -HUP \$MAINPID$", UNIT.read_text(), re.M)


def test_the_unit_waits_for_what_the_service_says_and_watches_that_it_goes_on() -> None:
    found = dict(re.findall(r"^(Type|NotifyAccess|WatchdogSec|Restart)=(.+)$", UNIT.read_text(), re.M))
    assert float(found.pop("WatchdogSec")) > 3 * STOP_TIMEOUT_S, "the service may take so long to end its roles"
    assert found == {"Type": "notify", "NotifyAccess": "main", "Restart": "always"}


def unit_command(parts: str = "") -> list[str]:
    """The command of the unit, with these `DECONFLICT_PARTS`."""
    command = re.search(r"^ExecStart=\S+/deconflict (.+)$", UNIT.read_text(), re.M)
    assert command
    return command[1].replace(" $DECONFLICT_PARTS", f" {parts}").split()


def test_the_command_of_the_unit_exists() -> None:
    args = parser().parse_args(unit_command())
    assert (args.command, args.part) == ("serve", None)


def test_the_unit_runs_the_parts_that_the_environment_of_the_machine_names() -> None:
    page = (ROOT / "docs" / "cluster.md").read_text()
    found = re.findall(r"^DECONFLICT_PARTS=(.+?)(?: +#.*)?$", page, re.M)
    assert found
    parts = [part for given in found for part in parser().parse_args(unit_command(given)).part]
    assert set(parts) == set(PARTS)
    lines = [line for line in UNIT.read_text().splitlines() if line.startswith("Environment")]
    assert [lines.index(line) for line in ("Environment=DECONFLICT_PARTS=", f"EnvironmentFile=-{ENVIRONMENT}")] == [
        0,
        1,
    ]
    assert f"`{ENVIRONMENT}`" in page


def steps() -> list[tuple[str, str]]:
    """The instructions of the container file, each with what it is given."""
    joined = CONTAINER.read_text().replace("\\\n", "")
    return [
        (keyword, " ".join(given.split()))
        for keyword, _, given in (line.partition(" ") for line in joined.splitlines())
    ]


def given(instruction: str) -> str:
    return next(given for keyword, given in reversed(steps()) if keyword == instruction)


def test_everything_that_the_container_installs_has_a_hash() -> None:
    (install,) = (step for keyword, step in steps() if keyword == "RUN" and "pip" in step)
    installs = [command for command in install.split(" && ") if "pip install" in command]
    assert len(installs) == 3
    known = ("--require-hashes --only-binary :all:", "--no-deps wheel/")
    assert all(any(option in command for option in known) for command in installs)
    assert "--no-build-isolation" in install


def test_the_container_runs_the_same_command_as_the_unit() -> None:
    command = [*json.loads(given("ENTRYPOINT")), *json.loads(given("CMD"))]
    assert [Path(command[0]).name, *command[1:]] == ["deconflict", *unit_command()]
    assert command[command.index("--data") + 1] in json.loads(given("VOLUME"))
    assert given("EXPOSE") == f"{DEFAULT.receiver.port} {DEFAULT.operator.port}"


def test_the_container_runs_as_a_user_of_its_own_and_ends_as_it_should() -> None:
    """By number, so that the owner of a volume is known and Kubernetes sees that it is not root."""
    words = [keyword for keyword, _ in steps()]
    made = next(step for keyword, step in steps() if keyword == "RUN" and "useradd" in step)
    user, group = (re.search(rf"{option} (\d+)", made) for option in ("useradd --uid", "groupadd --gid"))
    assert user
    assert group
    assert given("USER") == f"{user[1]}:{group[1]}"
    assert words.index("USER") < words.index("ENTRYPOINT")
    assert given("STOPSIGNAL") == "SIGTERM"


def test_the_health_check_of_the_container_asks_for_the_ports_of_the_site_file_that_it_runs() -> None:
    _, _, command = given("HEALTHCHECK").partition("CMD ")
    program, *arguments = json.loads(command)
    assert [program] == json.loads(given("ENTRYPOINT"))
    asked, served = parser().parse_args(arguments), parser().parse_args(json.loads(given("CMD")))
    assert (asked.command, asked.site) == ("alive", served.site)


def test_both_stages_of_the_container_begin_with_one_base_that_a_build_may_name_by_digest() -> None:
    assert [given.split()[0] for keyword, given in steps() if keyword == "FROM"] == ["${BASE}", "${BASE}"]
    assert given("ARG").startswith("BASE=docker.io/library/python:3.13")


def test_what_git_ignores_enters_no_image_whichever_program_builds_it() -> None:
    """docker reads .dockerignore only. podman reads it, too, unless there is a .containerignore."""
    ignored = (ROOT / ".gitignore").read_text().split()
    as_docker = {name.strip("/") if name.startswith("/") else f"**/{name.strip('/')}" for name in ignored}
    assert {".git", *as_docker} == set((ROOT / ".dockerignore").read_text().splitlines()[1:])
    assert not (ROOT / ".containerignore").exists()


def installs(text: str) -> list[str]:
    """The arguments of each `pip install` in it."""
    return re.findall(r"pip install (.+?)(?: +#.*)?$", text, re.M)


def test_the_documented_installation_builds_with_what_the_locks_have_so_it_needs_no_network() -> None:
    section = (ROOT / "docs" / "operation.md").read_text().partition("## With systemd")[2].partition("\n## ")[0]
    locked, built = installs(section)
    locks = re.findall(r"-r (\S+)", locked)
    assert locks == ["locks/runtime.txt", "locks/build.txt"]
    assert "--require-hashes --only-binary :all:" in locked
    assert built == "--no-deps --no-build-isolation ./deconflict_client ."
    download = re.search(r"pip download (.+)$", section, re.M)
    assert download
    assert re.findall(r"-r (\S+)", download[1]) == locks
    assert "PIP_NO_INDEX=1" in section


def test_kernels_are_kept_where_the_service_may_write() -> None:
    """Else an engine that is restarted compiles for a minute."""
    kept = re.search(r"^Environment=NUMBA_CACHE_DIR=(\S+)$", UNIT.read_text(), re.M)
    assert kept
    assert kept[1] == "/var/cache/" + re.findall(r"^CacheDirectory=(\S+)$", UNIT.read_text(), re.M)[0]
    assert given("ENV") == f"NUMBA_CACHE_DIR={kept[1]}"
    assert kept[1] in json.loads(given("VOLUME")), "nothing else can be written to with --read-only"


def services() -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(COMPOSE.read_text())
    return document["services"]


def test_every_file_that_a_container_mounts_exists_and_every_volume_is_declared() -> None:
    declared = yaml.safe_load(COMPOSE.read_text())["volumes"]
    sources = [mount.split(":")[0] for service in services().values() for mount in service.get("volumes", [])]
    assert len(sources) > 5
    for source in sources:
        assert (COMPOSE.parent / source).exists() if source.startswith(".") else source in declared


def test_the_commands_of_the_containers_are_understood_and_reach_nobody_but_this_machine() -> None:
    for name in ("deconflict", "simulated-robots"):
        assert parser().parse_args(services()[name]["command"]).run
    ports = [port for service in services().values() for port in service.get("ports", [])]
    assert ports
    assert all(port.startswith("127.0.0.1:") for port in ports)


def test_the_containers_are_limited_and_those_of_the_service_shut_in() -> None:
    for name, service in services().items():
        assert {"mem_limit", "pids_limit", "restart"} <= service.keys(), name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert {"max-size", "max-file"} <= service["logging"]["options"].keys(), name
        if service["image"] == "amr-deconflict":
            assert (service["cap_drop"], service["read_only"]) == (["ALL"], True), name
            assert service["tmpfs"], name
    unit = dict(re.findall(r"^(MemoryMax|LimitNOFILE)=(.+)$", UNIT.read_text(), re.M))
    served = services()["deconflict"]
    assert (served["mem_limit"].upper(), str(served["ulimits"]["nofile"])) == (unit["MemoryMax"], unit["LimitNOFILE"])
    assert served["cpus"]


def test_only_what_serves_is_asked_whether_it_is_alive() -> None:
    for name, service in services().items():
        if service["image"] == "amr-deconflict":
            assert service.get("healthcheck", {}).get("disable", False) == (service["command"][0] != "serve"), name


def test_grafana_finds_prometheus_and_prometheus_the_service() -> None:
    (source,) = yaml.safe_load((MONITORING / "grafana-datasources.yaml").read_text())["datasources"]
    assert source["url"] == "http://prometheus:9090"
    scraped = yaml.safe_load((MONITORING / "prometheus.yml").read_text())["scrape_configs"]
    assert scraped[0]["static_configs"] == [{"targets": [f"deconflict:{DEFAULT.operator.port}"]}]
    provider = yaml.safe_load((ROOT / "dashboards" / "grafana" / "provider.yml").read_text())
    path = provider["providers"][0]["options"]["path"]
    assert any(mount.split(":")[1] == path for mount in services()["grafana"]["volumes"])


@pytest.mark.skipif(shutil.which("promtool") is None, reason="promtool is not installed")
def test_prometheus_accepts_its_configuration_with_the_rules(tmp_path: Path) -> None:
    shutil.copy(MONITORING / "prometheus.yml", tmp_path)
    shutil.copytree(ROOT / "dashboards" / "prometheus", tmp_path / "rules")
    command = ["promtool", "check", "config", str(tmp_path / "prometheus.yml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "rules found" in done.stdout
