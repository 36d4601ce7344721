"""Metric names follow Prometheus conventions; rules, dashboards and pages name only metrics of the server."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from fastapi.testclient import TestClient
from prometheus_client.registry import CollectorRegistry
from server_fakes import Control, InThreadSteps
from server_fixtures import open_fake_bakes

from relume_server.app import create_app
from relume_server.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
MONITORING = ROOT / "docker" / "monitoring"
SUFFIXES = {"counter": ("_total",), "histogram": ("_bucket", "_sum", "_count"), "gauge": ("",)}
OF_PROMETHEUS = {"up"}
WORDS = {"and", "by", "histogram_quantile", "increase", "label_values", "le", "max", "rate", "sum"}
LABELS = {"format", "instance", "kind", "outcome", "reason", "state", "status"}


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CollectorRegistry]:
    """The metrics of a running server."""
    settings = Settings(data=tmp_path_factory.mktemp("metrics"), allowed_hosts=["testserver"], preload_importer=False)
    library = Control().open_library
    app = create_app(settings, open_library=library, open_steps=InThreadSteps, open_bakes=open_fake_bakes)
    with TestClient(app):
        yield app.state.services.metrics.registry


@pytest.fixture(scope="module")
def names(registry: CollectorRegistry) -> set[str]:
    """Names of all samples that the server may export."""
    sample_names = {family.name + suffix for family in registry.collect() for suffix in SUFFIXES[family.type]}
    assert "relume_edit_to_socket_seconds_bucket" in sample_names
    return sample_names | OF_PROMETHEUS


def expressions() -> dict[str, str]:
    """PromQL by the name of its rule or panel."""
    rules = yaml.safe_load((MONITORING / "alerts.yml").read_text())["groups"][0]["rules"]
    board = json.loads((MONITORING / "dashboard.json").read_text())
    expression_by_name = {rule["alert"]: rule["expr"] for rule in rules}
    for panel in board["panels"]:
        expression_by_name |= {f"{panel['title']} {target['refId']}": target["expr"] for target in panel["targets"]}
    expression_by_name["instances"] = board["templating"]["list"][1]["query"]["query"]
    return expression_by_name


@pytest.mark.parametrize("name", expressions())
def test_expressions_name_existing_metrics(name: str, names: set[str]) -> None:
    text = re.sub(r"\{[^}]*\}|\[[^\]]*\]", "", expressions()[name])  # matchers and ranges
    asked = set(re.findall(r"[A-Za-z_]\w*", text)) - WORDS - LABELS
    assert asked
    assert asked <= names


def test_matched_labels_exist(registry: CollectorRegistry) -> None:
    labels = {"instance", "job"}
    for collector in set(registry._collector_to_names):
        labels |= set(getattr(collector, "_labelnames", ()))
    labels |= {label for family in registry.collect() for sample in family.samples for label in sample.labels}
    for text in expressions().values():
        matched = {label for group in re.findall(r"\{([^}]*)\}", text) for label in re.findall(r"(\w+)\s*[!=]", group)}
        grouped = {label for group in re.findall(r"by \(([^)]*)\)", text) for label in re.findall(r"\w+", group)}
        assert matched | grouped <= labels, text


def test_shared_ledger_metrics_are_not_counted_twice() -> None:
    asked = [text for text in expressions().values() if "relume_jobs{" in text]
    assert len(asked) > 1
    assert all("instance" in text.partition("(")[2].partition(")")[0] or text.startswith("max by") for text in asked)


def test_counters_of_alerts_start_at_zero(registry: CollectorRegistry) -> None:
    assert registry.get_sample_value("relume_refused_sessions_total", {"reason": "busy"}) == 0.0


def test_metric_names_follow_the_conventions(registry: CollectorRegistry) -> None:
    for family in registry.collect():
        if not family.name.startswith("relume_"):
            continue
        assert re.fullmatch(r"relume_[a-z]+(_[a-z]+)*", family.name)
        assert not re.search(r"_(total|count|sum|bucket|ms|milliseconds|mb|kb|percent)$", family.name), family.name
        assert family.documentation[0].isupper()
        assert family.type != "histogram" or family.name.endswith("_seconds")


def test_pages_name_existing_metrics(names: set[str], registry: CollectorRegistry) -> None:
    text = (ROOT / "docs" / "operations.md").read_text()
    named = set(re.findall(r"`((?:relume|process)_[a-z_]+)", text))
    assert named
    assert named <= names | {family.name for family in registry.collect()}
