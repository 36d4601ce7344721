"""The container files: trusted proxies, networks and limits."""

from __future__ import annotations

import json
import re
import tomllib
from ipaddress import ip_address, ip_network
from pathlib import Path
from typing import Any

import pytest
import yaml

from relume_server.settings import Settings

DOCKER = Path(__file__).parents[2] / "docker"
GIB = 1024**3


class Loader(yaml.SafeLoader):
    """YAML with the tags of Compose."""


Loader.add_constructor("!reset", lambda loader, node: None)


def read(name: str) -> dict[str, Any]:
    configuration: dict[str, Any] = yaml.load((DOCKER / name).read_text(), Loader)
    return configuration


def networks(service: dict[str, Any]) -> set[str]:
    return set(service.get("networks", ()))


@pytest.mark.parametrize(
    ("name", "network"), [("compose.production.yml", "front"), ("compose.replicas.yml", "replicas")]
)
def test_only_the_proxy_is_trusted(name: str, network: str) -> None:
    file = read(name)
    (trusted,) = json.loads(file["services"]["server"]["environment"]["RELUME_TRUSTED_PROXIES"])
    assert trusted == file["services"]["proxy"]["networks"][network]["ipv4_address"]
    (pool,) = file["networks"][network]["ipam"]["config"]
    assert ip_address(trusted) in ip_network(pool["subnet"])
    assert ip_address(trusted) not in ip_network(pool["ip_range"])  # the range of all other addresses
    gateway = ip_network(pool["subnet"])[1]  # the address of processes on the host
    assert ip_address(trusted) != gateway
    assert networks(file["services"]["proxy"]) == {network}  # servers would not trust it in another shared network
    assert network in networks(file["services"]["server"])


def test_grafana_reaches_only_prometheus() -> None:
    services = read("compose.production.yml")["services"]
    assert networks(services["grafana"]) & networks(services["server"]) == set()
    assert networks(services["grafana"]) & networks(services["proxy"]) == set()
    assert networks(services["grafana"]) & networks(services["prometheus"])
    assert services["grafana"]["environment"]["GF_SECURITY_ADMIN_PASSWORD__FILE"] == "/run/secrets/grafana_password"


@pytest.mark.parametrize("name", ["compose.production.yml", "compose.replicas.yml"])
def test_services_have_minimal_privileges(name: str) -> None:
    for service in read(name)["services"].values():
        if "image" in service:
            assert service["cap_drop"] == ["ALL"]
            assert service["security_opt"] == ["no-new-privileges:true"]
            assert service["mem_limit"]


def test_server_caches_fit_the_memory_limit() -> None:
    server = read("compose.yml")["services"]["server"]
    given = {key: int(server["environment"][f"RELUME_{key}_BYTES"]) for key in ("CACHE", "BATCH", "IMPORT")}
    imports_at_once = 2
    assert server["mem_limit"] == "8g"
    assert given["CACHE"] + given["BATCH"] + imports_at_once * given["IMPORT"] < 8 * GIB


def test_variables_are_settings() -> None:
    text = "".join(path.read_text() for path in DOCKER.glob("compose*.yml"))
    named = set(re.findall(r"^ +RELUME_([A-Z_]+):", text, re.MULTILINE))
    assert {name.lower() for name in named} - {"storage", "host_name"} <= set(Settings.model_fields)


def test_secret_files_are_ignored_by_git_and_docker() -> None:
    secrets = {each["file"].removeprefix("./") for each in read("compose.production.yml")["secrets"].values()}
    for name in (".gitignore", ".dockerignore"):
        assert {f"docker/{secret}" for secret in secrets} <= set((DOCKER.parent / name).read_text().split())


def test_image_contains_all_packages_of_the_wheel() -> None:
    project = tomllib.loads((DOCKER.parent / "pyproject.toml").read_text())
    packages = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    folders = {package.partition("/")[0] for package in packages}
    copied = set(re.findall(r"^COPY (\w+)/ \1/$", (DOCKER / "Dockerfile").read_text(), re.MULTILINE))
    assert folders <= copied
    assert {f"!{folder}/" for folder in folders} <= set((DOCKER.parent / ".dockerignore").read_text().split())


def test_team_overlay_gives_time_to_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    server, plain = (read(name)["services"]["server"] for name in ("compose.production.yml", "compose.yml"))
    for name, value in server["environment"].items():
        monkeypatch.setenv(name, re.sub(r"\$\{(\w+)[^}]*\}", "relight.example.org", value))
    settings = Settings(data=tmp_path)
    assert settings.login
    assert settings.https_only
    assert "relight.example.org" in settings.allowed_hosts
    assert settings.drain_seconds + settings.stop_seconds < float(plain["stop_grace_period"].removesuffix("s"))


@pytest.mark.parametrize("name", ["compose.production.yml", "compose.replicas.yml"])
def test_files_mounted_by_the_overlay_exist(name: str) -> None:
    for service in read(name)["services"].values():
        for volume in service.get("volumes", ()):
            if volume.startswith("./"):
                assert (DOCKER / volume.split(":")[0]).is_file(), volume
