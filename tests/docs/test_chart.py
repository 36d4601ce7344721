"""The chart for Kubernetes: sets what there is, and takes the configuration of nginx that is tried elsewhere."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from server.settings import Settings

ROOT = Path(__file__).parents[2]
CHART = ROOT / "docker" / "helm" / "relume"
TEMPLATES = {path.name: path.read_text() for path in (CHART / "templates").iterdir()}
SECRET = ["--set", "database.secretName=relume-database"]
FULL = [
    *SECRET,
    "--set=server.replicas=3,storage.url=s3://a/b,storage.secretName=aws,ingress.enabled=true",
    "--set=ingress.host=relight.example.org,ingress.tlsSecret=tls,server.environment.RELUME_TRACES=true",
]


def test_variables_are_settings() -> None:
    named = set(re.findall(r"name: RELUME_([A-Z_]+)", "".join(TEMPLATES.values())))
    assert {name.lower() for name in named} - {"storage"} <= set(Settings.model_fields)
    assert named >= {"DATABASE", "DATA", "LOGIN", "ALLOWED_HOSTS"}


def test_values_that_templates_take_are_there() -> None:
    values = yaml.safe_load((CHART / "values.yaml").read_text())
    for path in re.findall(r"\.Values\.([A-Za-z.]+)", "".join(TEMPLATES.values())):
        found = values
        for part in path.split("."):
            assert part in found, path
            found = found[part]


def test_nginx_is_the_one_that_is_tried() -> None:
    assert (CHART / "nginx.conf").resolve() == ROOT / "docker" / "replicas" / "nginx.conf"
    (pattern,) = re.findall(r'regexReplaceAll "([^"]+)"', TEMPLATES["proxy.yaml"])
    assert len(re.findall(pattern.replace("\\n", "\n"), (CHART / "nginx.conf").read_text())) == 1


@pytest.mark.parametrize("options", [SECRET, FULL])
def test_helm_has_nothing_to_say(options: list[str]) -> None:
    helm = shutil.which("helm")
    if helm is None:
        pytest.skip("helm is not installed")
    subprocess.run([helm, "lint", "--strict", str(CHART), *options], check=True)
    told = subprocess.run([helm, "template", str(CHART), *options], check=True, capture_output=True, text=True).stdout
    kinds = [document["kind"] for document in yaml.safe_load_all(told) if document]
    assert {"StatefulSet", "Deployment", "ConfigMap", "Service"} <= set(kinds)
