"""The Kubernetes chart sets existing settings and values, and uses the tested nginx configuration."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from relume_server.settings import Settings

ROOT = Path(__file__).parents[2]
CHART = ROOT / "docker" / "helm" / "relume"
TEMPLATES = {path.name: path.read_text() for path in (CHART / "templates").iterdir()}
SECRET = ["--set", "database.secretName=relume-database"]
FULL = [
    *SECRET,
    "--set=server.replicas=3,storage.url=s3://a/b,storage.secretName=aws,ingress.enabled=true",
    "--set=ingress.host=relight.example.org,ingress.tlsSecret=tls",
    "--set-string=server.environment.RELUME_TRACES=true",
    "--set=proxy.realIpFrom={10.0.0.0/8},networkPolicy.from[0].podSelector.matchLabels.app=prometheus",
]


def test_variables_are_settings() -> None:
    named = set(re.findall(r"name: RELUME_([A-Z_]+)", "".join(TEMPLATES.values())))
    assert {name.lower() for name in named} - {"storage"} <= set(Settings.model_fields)
    assert named >= {"DATABASE", "DATA", "LOGIN", "ALLOWED_HOSTS"}


def test_template_values_exist() -> None:
    values = yaml.safe_load((CHART / "values.yaml").read_text())
    for path in re.findall(r"\.Values\.([A-Za-z.]+)", "".join(TEMPLATES.values())):
        value = values
        for key in path.split("."):
            assert key in value, path
            value = value[key]


def test_nginx_configuration_is_the_tested_one() -> None:
    assert (CHART / "nginx.conf").resolve() == ROOT / "docker" / "replicas" / "nginx.conf"
    (pattern,) = re.findall(r'regexReplaceAll "([^"]+)"', TEMPLATES["proxy.yaml"])
    assert len(re.findall(pattern.replace("\\n", "\n"), (CHART / "nginx.conf").read_text())) == 1


def test_servers_trust_only_the_proxy_pods() -> None:
    server, policy, proxy = (TEMPLATES[name] for name in ("server.yaml", "policy.yaml", "proxy.yaml"))
    assert re.search(r'RELUME_TRUSTED_PROXIES\n +value: {{ list \(printf "%s-proxy.%s.svc"', server)
    (headless,) = [document for document in proxy.split("\n---\n") if "clusterIP: None" in document]
    assert "name: {{ $name }}-proxy" in headless  # the name resolves to the addresses of the pods
    assert "kind: NetworkPolicy" in policy
    assert "app.kubernetes.io/component: proxy" in policy
    values = yaml.safe_load((CHART / "values.yaml").read_text())
    assert "trustedProxies" not in values
    assert values["networkPolicy"]["from"] == values["proxy"]["realIpFrom"] == []


def test_client_addresses_pass_the_ingress() -> None:
    (marker,) = re.findall(r'replace "([^"]+)"', TEMPLATES["proxy.yaml"])
    assert (CHART / "nginx.conf").read_text().count(marker) == 1


def test_installation_warns_if_all_clients_share_the_address_of_the_ingress() -> None:
    """`helm template` does not print the notes."""
    (warning,) = re.findall(
        r"{{- if and \.Values\.ingress\.enabled \(not \.Values\.proxy\.realIpFrom\) }}\n(.*?){{- end }}",
        TEMPLATES["NOTES.txt"],
        re.DOTALL,
    )
    assert "WARNING: all clients share the ingress's address" in warning
    assert "proxy.realIpFrom" in warning


@pytest.mark.parametrize("options", [SECRET, FULL])
def test_chart_passes_helm_lint_and_renders(options: list[str]) -> None:
    helm = shutil.which("helm")
    if helm is None:
        pytest.skip("helm is not installed")
    subprocess.run([helm, "lint", "--strict", str(CHART), *options], check=True)
    output = subprocess.run([helm, "template", str(CHART), *options], check=True, capture_output=True, text=True).stdout
    kinds = [document["kind"] for document in yaml.safe_load_all(output) if document]
    assert {"StatefulSet", "Deployment", "ConfigMap", "Service", "NetworkPolicy"} <= set(kinds)
    is_full = options == FULL
    assert ("set_real_ip_from 10.0.0.0/8;" in output) == is_full
    assert ("RELUME_HTTPS_ONLY" in output) == is_full
